"""What a roboticist would use first for a skid-steered robot: kinematics of a few parameters, by least squares.

Body: planar pose, columns `yaw_rate`, `wheel_left`, `wheel_right`, commands
`command_left`, `command_right` (rad/s). Wheels follow their commands with a lag and
saturate; motion follows the mean wheel speeds of the step. Of an ideal differential
drive forward speed is r (w_l + w_r) / 2 and yaw rate r (w_r - w_l) / B. With
instantaneous centres of rotation (Mandow et al., 2007) each side has a speed and a
lever of its own, and the robot slips sideways as it turns.
"""

from __future__ import annotations

from typing import Literal

import torch
from torch import Tensor

from sidm.body import Body
from sidm.config import ConfigError
from sidm.learning.dataset import Datasets
from sidm.learning.model import Predictor
from sidm.learning.networks import Memory
from sidm.learning.stopping import Tested
from sidm.learning.training import Trained

INPUTS = ("yaw_rate", "wheel_left", "wheel_right", "command_left", "command_right")
TARGETS = ("forward", "left", "turn", "yaw_rate", "wheel_left", "wheel_right")
Model = Literal["differential_drive", "rotation_centres"]


class Kinematics(Predictor):
    """Predicts transitions (B, T, 6) of a skid-steered robot; its parameters are zero until they are identified.

    Args:
        model: an ideal differential drive, or one with instantaneous centres of
            rotation.
        rate: control steps a second, Hz.
        scale: weights (6,) of the components in equation (1).
    """

    def __init__(self, model: Model, rate: float, scale: Tensor | None = None):
        super().__init__()
        self.model, self.rate = model, rate
        self.register_buffer("scale", scale, persistent=False)
        # of the way to the command, a step
        self.lag = torch.nn.Parameter(torch.zeros(()), requires_grad=False)
        # wheel, rad/s
        self.fastest = torch.nn.Parameter(torch.zeros(()), requires_grad=False)
        # wheels to m/s and rad/s
        self.jacobian = torch.nn.Parameter(torch.zeros(2, 2), requires_grad=False)
        # m, of the centres behind the middle
        self.behind = torch.nn.Parameter(torch.zeros(()), requires_grad=False)

    def loss_weights(self, role: str) -> Tensor | None:
        """Weights (6,) of the components in equation (1)."""
        return self.scale  # type: ignore[return-value]

    def forward(
        self, role: str, inputs: Tensor, maps: Tensor, memory: Memory | None = None
    ):
        """Transitions (B, T, 6), raw units, as DynamicsModel; there is no memory."""
        wheels = inputs[..., 1:3]
        # of the step
        after = wheels + self.lag * (
            inputs[..., 3:5].clamp(-self.fastest, self.fastest) - wheels
        )
        speed, rate = ((wheels + after) / 2 @ self.jacobian.T).unbind(-1)
        turn = rate / self.rate
        way = speed / self.rate
        left = way * turn / 2 + self.behind * turn  # half of an arc, and the slip
        next_rate = after @ self.jacobian[1]
        return torch.stack([way, left, turn, next_rate, *after.unbind(-1)], -1), memory


def identify(
    datasets: Datasets, body: Body, model: Model, scale: Tensor | None = None
) -> Trained:
    """The parameters that explain the novice's steps best, train and test together.

    Raises:
        ConfigError: a body that is not that of a skid-steered robot.
    """
    if (body.inputs, body.targets) != (INPUTS, TARGETS):
        raise ConfigError(
            f"kinematics are those of a robot with {', '.join(INPUTS)}, not of '{body.name}'"
        )
    found = Kinematics(model, body.rate, scale)
    parts = [
        part for one in (datasets.train, datasets.test) for part in one.split(len(one))
    ]
    x = torch.cat([part.inputs for part in parts]).flatten(0, 1).double()
    y = torch.cat([part.targets for part in parts]).flatten(0, 1).double()
    wheels, commands, after = x[:, 1:3], x[:, 3:5], y[:, 4:6]
    found.fastest.copy_(wheels.abs().max())
    error = commands.clamp(-float(found.fastest), float(found.fastest)) - wheels
    found.lag.copy_(
        (error * (after - wheels)).sum() / error.square().sum().clamp_min(1e-9)
    )
    mean = (wheels + after) / 2
    if model == "differential_drive":
        both, apart = mean.sum(1, keepdim=True) / 2, mean[:, 1:] - mean[:, :1]
        radius = _slope(both, y[:, 0] * body.rate)
        turning = _slope(apart, y[:, 2] * body.rate)
        found.jacobian.copy_(
            torch.stack(
                [
                    torch.stack([radius / 2, radius / 2]),
                    torch.stack([-turning, turning]),
                ]
            )
        )
    else:
        speeds = torch.stack([y[:, 0], y[:, 2]], 1) * body.rate
        found.jacobian.copy_(torch.linalg.lstsq(mean, speeds).solution.T)
        turn = y[:, 2:3]
        found.behind.copy_(_slope(turn, y[:, 1] - y[:, 0] * y[:, 2] / 2))
    predicted, _ = found("novice", x.float()[None], x.new_zeros(1, len(x), 0, 0))
    weights = torch.ones(len(TARGETS)) if scale is None else scale
    loss = float(((predicted[0] - y).square() * weights).sum(-1).mean())
    return Trained(
        found.eval(), [Tested(len(x), loss, loss, None)], len(x), 0, loss, len(x), True
    )


def _slope(x: Tensor, y: Tensor) -> Tensor:
    """Of y (N,) on x (N, 1) through the origin."""
    return (x[:, 0] * y).sum() / x.square().sum().clamp_min(1e-9)
