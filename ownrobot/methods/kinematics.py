"""Kinematic models of a wheeled robot, with a few parameters by least squares.

A roboticist would try them first. Motion follows the robot's two signals, which
`drivetrain` finds in the body, at their mean over the step:

- an ideal differential drive: forward speed r (w_l + w_r) / 2, yaw rate
  r (w_r - w_l) / B;
- instantaneous centres of rotation (Mandow et al., 2007), for skid-steered robots: each
  side has its own speed and its own lever, and the robot slips sideways as it turns;
- a kinematic bicycle (Ackermann steering): yaw rate v tan(steering) / L; steering
  without a unit stands for the curvature. The pose may be that of any point on the
  robot's long axis.

Motion is flat: other components of a spatial pose's change are their means. Columns of
the robot's speed and yaw rate follow the motion. A wheel follows its own command with
a lag and saturates. Every other column has a first-order lag towards a linear function
of all commands.
"""

from __future__ import annotations

import functools

import torch
from torch import Tensor

from ownrobot.methods.closed_form import (
    ClosedForm,
    columns_and_actions,
    fitted,
    weights_of,
)
from ownrobot.methods.drivetrain import Model, drivetrain_of
from sidm import rotations
from sidm.body import SI, Body
from sidm.learning.dataset import Datasets
from sidm.learning.networks import Memory
from sidm.learning.training import Trained

LARGEST_STEERING = 1.4  # rad; the tangent of a larger angle has no meaning


class Kinematics(ClosedForm):
    """Predicts transitions (B, T, Y) of a wheeled robot.

    The parameters are zero until they are identified.
    """

    def __init__(self, model: Model, body: Body, scale: Tensor | None = None):
        super().__init__(scale)
        self.model, self.body = model, body
        self.drivetrain = drivetrain_of(body, model)
        columns, actions = len(body.columns), len(body.actions)
        fixed = functools.partial(torch.nn.Parameter, requires_grad=False)
        # Share of the difference to its command that a wheel makes up for in a step.
        self.lag = fixed(torch.zeros(()))
        self.wheel_limit = fixed(torch.zeros(()))  # rad/s or m/s
        # Forward speed, m/s, and yaw rate, rad/s, from the two numbers of `features`.
        self.jacobian = fixed(torch.zeros(2, 2))
        # m, distance of the centre of rotation behind the point that has the pose.
        self.centre_offset = fixed(torch.zeros(()))
        # Means of up, rotation x and rotation y of a spatial pose's change.
        self.rest = fixed(torch.zeros(3))
        # Change of a column in a step: push @ actions + level - decay * column.
        self.push = fixed(torch.zeros(columns, actions))
        self.level = fixed(torch.zeros(columns))
        self.decay = fixed(torch.zeros(columns))

    def forward(
        self, role: str, inputs: Tensor, maps: Tensor, memory: Memory | None = None
    ):
        """Transitions (B, T, Y) in raw units; `memory` is returned as it is."""
        columns, actions = columns_and_actions(inputs, self.body)
        after = self._next_columns(columns, actions)
        before = self.signals(columns, actions)
        at_end = self.signals(torch.stack(after, -1), actions)
        features = self.features((before + at_end) / 2)
        speed, yaw_rate = (features @ self.jacobian.T).unbind(-1)
        for row, column in enumerate((self.drivetrain.speed, self.drivetrain.yaw_rate)):
            if column is not None:
                after[column] = self.features(at_end) @ self.jacobian[row]
        motion = self._pose_change(speed / self.body.rate, yaw_rate / self.body.rate)
        return torch.stack([*motion, *after], -1), memory

    def signals(self, columns: Tensor, actions: Tensor) -> Tensor:
        """The drivetrain's two signals (..., 2)."""
        means = [
            (columns if signal.measured else actions)[..., list(signal.indices)].mean(
                -1
            )
            for signal in (self.drivetrain.first, self.drivetrain.second)
        ]
        return torch.stack(means, -1)

    def features(self, signals: Tensor) -> Tensor:
        """Numbers (..., 2), from signals (..., 2), in which the motion is linear."""
        if self.drivetrain.kind != "steered":
            return signals
        speed, steering = signals.unbind(-1)
        (index,), measured = self.drivetrain.second
        unit = (self.body.columns if measured else self.body.actions)[index][1]
        if SI.get(unit) == "rad":
            steering = steering.clamp(-LARGEST_STEERING, LARGEST_STEERING).tan()
        return torch.stack([speed, speed * steering], -1)

    def _next_columns(self, columns: Tensor, actions: Tensor) -> list[Tensor]:
        """Columns (...) at the end of the step, one tensor each."""
        change = actions @ self.push.T + self.level - self.decay * columns
        after = list((columns + change).unbind(-1))
        for column, action in self.drivetrain.followed.items():
            wheel, command = columns[..., column], actions[..., action]
            reachable = command.clamp(-self.wheel_limit, self.wheel_limit)
            after[column] = wheel + self.lag * (reachable - wheel)
        return after

    def _pose_change(self, forward: Tensor, turn: Tensor) -> list[Tensor]:
        """Components (...) of the pose's change, from m and rad along an arc."""
        # The end of the arc lies forward * turn / 2 to the left; the slip adds to it.
        left = forward * turn / 2 + self.centre_offset * turn
        if self.body.pose == "none":
            return []
        if self.body.pose == "planar":
            return [forward, left, turn]
        rest = [mean.expand_as(turn) for mean in self.rest]
        return [forward, left, *rest, (turn / 2).sin(), (turn / 2).cos()]


def identify(
    datasets: Datasets, body: Body, model: Model, scale: Tensor | None = None
) -> Trained:
    """Fit the parameters to the novice's steps, train and test split together.

    The test loss is that on all these steps.
    """
    found = Kinematics(model, body, scale)
    x, y = (
        torch.cat([getattr(part, name) for part in datasets[:2]]).flatten(0, 1).double()
        for name in ("inputs", "targets")
    )
    columns, actions = columns_and_actions(x, body)
    after = y[:, body.pose_size :]
    _fit_wheels(found, columns, actions, after)
    _fit_other_columns(found, columns, actions, after)
    _fit_motion(found, columns, actions, y)
    predicted, _ = found("novice", x.float()[None], x.new_zeros(1, len(x), 0, 0))
    squares = (predicted[0] - y).square() * weights_of(body, scale)
    loss = float(squares.sum(-1).mean())
    return fitted(found, len(x), loss, loss)


def _fit_wheels(
    fitted: Kinematics, columns: Tensor, actions: Tensor, after: Tensor
) -> None:
    """Lag and saturation of wheels that follow a command of their own."""
    if not fitted.drivetrain.followed:
        return
    numbers, commands = zip(*fitted.drivetrain.followed.items(), strict=True)
    wheels, after = columns[:, list(numbers)], after[:, list(numbers)]
    fitted.wheel_limit.copy_(wheels.abs().max())
    limit = float(fitted.wheel_limit)
    error = actions[:, list(commands)].clamp(-limit, limit) - wheels
    fitted.lag.copy_(_slope(error, after - wheels))


def _fit_other_columns(
    fitted: Kinematics, columns: Tensor, actions: Tensor, after: Tensor
) -> None:
    """First-order lags of the columns that follow neither motion nor a wheel's command.

    A lag of less than none or more than a whole step has no meaning: the bound is
    taken, and the linear function is fitted again.
    """
    terms = torch.cat([actions, torch.ones_like(actions[:, :1])], 1)
    train = fitted.drivetrain
    for column in range(columns.shape[1]):
        if column in (*train.followed, train.speed, train.yaw_rate):
            continue
        before = columns[:, column : column + 1]
        change = after[:, column : column + 1] - before
        decay = -float(_solve(torch.cat([terms, before], 1), change)[-1])
        decay = min(max(decay, 0.0), 1.0)
        solution = _solve(terms, change + decay * before)[:, 0]
        fitted.push[column].copy_(solution[:-1])
        fitted.level[column].copy_(solution[-1])
        fitted.decay[column].fill_(decay)


def _fit_motion(
    fitted: Kinematics, columns: Tensor, actions: Tensor, y: Tensor
) -> None:
    """Parameters of the motion: from the pose or, without a pose, from columns."""
    body, after = fitted.body, y[:, fitted.body.pose_size :]
    before, at_end = (fitted.signals(part, actions) for part in (columns, after))
    if body.pose == "none":
        signals = at_end
        indices = fitted.drivetrain.speed, fitted.drivetrain.yaw_rate
        nothing = torch.zeros_like(y[:, 0])
        speeds = [nothing if i is None else after[:, i] for i in indices]
    else:
        signals = (before + at_end) / 2
        turn = y[:, 2] if body.pose == "planar" else rotations.yaw(y[:, 3:7])
        speeds = [y[:, 0] * body.rate, turn * body.rate]
    features = fitted.features(signals)
    if fitted.model == "rotation_centres":
        solution = torch.linalg.lstsq(features, torch.stack(speeds, 1)).solution
        fitted.jacobian.copy_(solution.T)
    elif fitted.drivetrain.kind == "sides":
        average = features.sum(1, keepdim=True) / 2
        difference = features[:, 1:] - features[:, :1]
        radius, turning = _slope(average, speeds[0]), _slope(difference, speeds[1])
        rows = torch.stack([radius / 2, radius / 2]), torch.stack([-turning, turning])
        fitted.jacobian.copy_(torch.stack(rows))
    else:
        slopes = [_slope(features[:, i : i + 1], speeds[i]) for i in range(2)]
        fitted.jacobian.copy_(torch.stack(slopes).diag())
    if body.pose == "spatial":
        fitted.rest.copy_(y[:, 2:5].mean(0))
    if body.pose != "none" and fitted.model != "differential_drive":
        slip = y[:, 1] - y[:, 0] * turn / 2
        fitted.centre_offset.copy_(_slope(turn[:, None], slip))


def _solve(terms: Tensor, y: Tensor) -> Tensor:
    """Smallest weights (F, 1) of the terms (N, F) that fit y (N, 1) best."""
    return torch.linalg.lstsq(terms, y, driver="gelsd").solution


def _slope(x: Tensor, y: Tensor) -> Tensor:
    """Slope () of the line through the origin that fits y over x (N, K) best.

    y has the shape of x, or (N,) for K = 1.
    """
    y = y.reshape(x.shape)
    return (x * y).sum() / x.square().sum().clamp_min(1e-9)
