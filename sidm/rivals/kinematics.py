"""Kinematic models of a skid-steered robot, with a few parameters by least squares.

A roboticist would try them first. The robot's body has a planar pose, the columns
`yaw_rate`, `wheel_left`, `wheel_right` and the commands `command_left`, `command_right`
(all rad/s). Wheels follow their commands with a lag and saturate; motion follows the
mean wheel speeds of the step. In an ideal differential drive the forward speed is
r (w_l + w_r) / 2 and the yaw rate r (w_r - w_l) / B. With instantaneous centres of
rotation (Mandow et al., 2007) each side has its own speed and its own lever, and the
robot slips sideways as it turns.
"""

from __future__ import annotations

import functools
from typing import Literal

import torch
from torch import Tensor

from sidm.body import Body
from sidm.config import ConfigError
from sidm.learning.dataset import Datasets
from sidm.learning.model import Predictor
from sidm.learning.networks import Memory
from sidm.learning.stopping import CurvePoint
from sidm.learning.training import Trained

INPUTS = ("yaw_rate", "wheel_left", "wheel_right", "command_left", "command_right")
TARGETS = ("forward", "left", "turn", "yaw_rate", "wheel_left", "wheel_right")
Model = Literal["differential_drive", "rotation_centres"]


class Kinematics(Predictor):
    """Predicts transitions (B, T, 6) of a skid-steered robot.

    The parameters are zero until they are identified.

    Args:
        model: an ideal differential drive, or a drive with instantaneous centres of
            rotation.
        rate: control steps a second, Hz.
        scale: weights (6,) of the components in equation (1).
    """

    def __init__(self, model: Model, rate: float, scale: Tensor | None = None):
        super().__init__()
        self.model, self.rate = model, rate
        self.register_buffer("scale", scale, persistent=False)
        fixed = functools.partial(torch.nn.Parameter, requires_grad=False)
        # Share of the difference to its command that a wheel makes up for in a step.
        self.lag = fixed(torch.zeros(()))
        self.wheel_limit = fixed(torch.zeros(()))  # rad/s
        # Forward speed, m/s, and yaw rate, rad/s, from both wheels' speeds, rad/s.
        self.jacobian = fixed(torch.zeros(2, 2))
        # m, distance of the centres of rotation behind the robot's middle.
        self.centre_offset = fixed(torch.zeros(()))

    def loss_weights(self, role: str) -> Tensor | None:
        """Weights (6,) of the components in equation (1)."""
        return self.scale  # type: ignore[return-value]

    def forward(
        self, role: str, inputs: Tensor, maps: Tensor, memory: Memory | None = None
    ):
        """Transitions (B, T, 6) in raw units; `memory` is returned as it is."""
        wheels, commands = inputs[..., 1:3], inputs[..., 3:5]
        reachable = commands.clamp(-self.wheel_limit, self.wheel_limit)
        after = wheels + self.lag * (reachable - wheels)  # at the end of the step
        speed, yaw_rate = ((wheels + after) / 2 @ self.jacobian.T).unbind(-1)
        forward, turn = speed / self.rate, yaw_rate / self.rate
        # The end of the arc lies forward * turn / 2 to the left; the slip adds to it.
        left = forward * turn / 2 + self.centre_offset * turn
        motion = [forward, left, turn, after @ self.jacobian[1]]
        return torch.stack([*motion, *after.unbind(-1)], -1), memory


def identify(
    datasets: Datasets, body: Body, model: Model, scale: Tensor | None = None
) -> Trained:
    """Fit the parameters to the novice's steps, train and test split together.

    Args:
        datasets: the novice's train and test split; the other data are not used.
        body: the robot's body.
        model: which of the two kinematic models.
        scale: weights (6,) of the components in equation (1); all 1 by default.

    Returns:
        The model and its training; the test loss is that on all steps.

    Raises:
        ConfigError: the body is not that of a skid-steered robot.
    """
    if (body.inputs, body.targets) != (INPUTS, TARGETS):
        wanted = ", ".join(INPUTS)
        raise ConfigError(
            f"kinematics are those of a robot with {wanted}, not of '{body.name}'"
        )
    fitted = Kinematics(model, body.rate, scale)
    sets = datasets.train, datasets.test
    parts = [part for windows in sets for part in windows.split(len(windows))]
    x = torch.cat([part.inputs for part in parts]).flatten(0, 1).double()
    y = torch.cat([part.targets for part in parts]).flatten(0, 1).double()
    wheels, commands, after = x[:, 1:3], x[:, 3:5], y[:, 4:6]
    fitted.wheel_limit.copy_(wheels.abs().max())
    limit = float(fitted.wheel_limit)
    error, change = commands.clamp(-limit, limit) - wheels, after - wheels
    fitted.lag.copy_((error * change).sum() / error.square().sum().clamp_min(1e-9))
    mean = (wheels + after) / 2
    if model == "differential_drive":
        average, difference = mean.sum(1, keepdim=True) / 2, mean[:, 1:] - mean[:, :1]
        radius = _slope(average, y[:, 0] * body.rate)
        turning = _slope(difference, y[:, 2] * body.rate)
        rows = torch.stack([radius / 2, radius / 2]), torch.stack([-turning, turning])
        fitted.jacobian.copy_(torch.stack(rows))
    else:
        speeds = torch.stack([y[:, 0], y[:, 2]], 1) * body.rate
        fitted.jacobian.copy_(torch.linalg.lstsq(mean, speeds).solution.T)
        slip = y[:, 1] - y[:, 0] * y[:, 2] / 2
        fitted.centre_offset.copy_(_slope(y[:, 2:3], slip))
    predicted, _ = fitted("novice", x.float()[None], x.new_zeros(1, len(x), 0, 0))
    weights = torch.ones(len(TARGETS)) if scale is None else scale
    loss = float(((predicted[0] - y).square() * weights).sum(-1).mean())
    curve = [CurvePoint(len(x), loss, loss, None)]
    return Trained(fitted.eval(), curve, len(x), 0, loss, len(x), True)


def _slope(x: Tensor, y: Tensor) -> Tensor:
    """Slope () of the line through the origin that fits y (N,) over x (N, 1) best."""
    return (x[:, 0] * y).sum() / x.square().sum().clamp_min(1e-9)
