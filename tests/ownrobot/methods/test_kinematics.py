"""Kinematic models find the parameters of synthetic drives, and drive with them."""

from pathlib import Path

import numpy as np
import pytest
import torch

import ownrobot
from ownrobot.methods.closed_form import learn_trivial
from ownrobot.methods.drivetrain import Signal, drivetrain_of
from ownrobot.methods.kinematics import identify
from sidm.body import ROVER
from sidm.config import ConfigError, replace
from sidm.learning.dataset import Datasets, Windows
from sidm.learning.evaluation import mean_loss
from tests.ownrobot.cart import planar

RECORDINGS = Path(__file__).parents[3] / "recordings"
RATE, LAG = 10.0, 0.4
WHEELS = {"wheel_left": "rad/s", "wheel_right": "rad/s"}
FOUR = [f"{place}_wheel" for place in "right_1 left_1 right_2 left_2".split()]
COMMANDS = {"command_left": "rad/s", "command_right": "rad/s"}
SKID = planar("skid", {"yaw_rate": "rad/s"} | WHEELS, COMMANDS)
FOUR_WHEELS = planar("four", dict.fromkeys(FOUR, "rad/s"), {"left": "1", "right": "1"})
LINEAR = {"linear": "m/s", "angular": "rad/s"}
TWIST = planar("bag", {"vx": "m/s", "wz": "rad/s", "current": "1"}, LINEAR)
CAR = planar(
    "car", {"speed": "m/s", "yaw_rate": "rad/s"}, {"throttle": "1", "steering": "rad"}
)


def lagged(commands: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Speeds (N, T, K) before and after each step, which follow commands (N, T, K)."""
    speeds = np.zeros((len(commands), commands.shape[1] + 1, commands.shape[2]))
    for step in range(commands.shape[1]):
        now = speeds[:, step]
        speeds[:, step + 1] = now + LAG * (commands[:, step] - now)
    return speeds[:, :-1], speeds[:, 1:]


def held_commands(rng, *size: int) -> np.ndarray:
    windows, steps, count = size
    drawn = rng.uniform(-1, 1, (windows, -(-steps // 5), count))
    return np.repeat(drawn, 5, axis=1)[:, :steps]


def wheel_commands(rng) -> np.ndarray:
    """Commands (24, 20, 2) up to 8 rad/s, a speed that the wheels once reach."""
    commands = 8 * held_commands(rng, 24, 20, 2)
    commands[0] = 8
    return commands


def datasets(inputs, targets) -> Datasets:
    """Inputs (N, T, X) and targets (N, T, Y); every fourth window is for the test."""
    x, y = (torch.from_numpy(np.stack(part, -1)).float() for part in (inputs, targets))
    windows = Windows(x, y, torch.zeros(*x.shape[:2], 0, 0))
    test = torch.arange(len(x)) % 4 == 1
    train, test = (
        windows.take(torch.nonzero(rows).flatten()) for rows in (~test, test)
    )
    return Datasets(train, test, test)


def arc(speed, yaw_rate, offset=0.0):
    forward, turn = speed / RATE, yaw_rate / RATE
    return forward, forward * turn / 2 + offset * turn, turn


def test_a_differential_drive_is_found_in_noise(rng):
    radius, track = 0.15, 0.6
    commands = wheel_commands(rng)
    before, after = lagged(commands)
    left, right = ((before + after) / 2).transpose(2, 0, 1)
    motion = arc(radius * (left + right) / 2, radius * (right - left) / track)
    motion = [part + rng.normal(0, 0.01, part.shape) for part in motion]
    gyro = radius * np.diff(after)[..., 0] / track
    sets = datasets(
        [0 * gyro, *np.moveaxis(before, 2, 0), *np.moveaxis(commands, 2, 0)],
        [*motion, gyro, *np.moveaxis(after, 2, 0)],
    )
    model = identify(sets, SKID, "differential_drive").model
    average, turning = radius / 2, radius / track
    expected = [[average, average], [-turning, turning]]
    assert np.allclose(model.jacobian, expected, rtol=0.03)
    assert float(model.lag) == pytest.approx(LAG, rel=1e-3)
    mean = learn_trivial(sets, SKID, "mean").model
    assert mean_loss(model, sets.test) < 0.01 * mean_loss(mean, sets.test)


def test_slip_and_uneven_sides_are_found_where_an_ideal_drive_cannot(rng):
    jacobian, offset = np.array([[0.08, 0.06], [-0.2, 0.24]]), -0.1
    commands = wheel_commands(rng)
    before, after = lagged(commands)
    speed, yaw_rate = np.moveaxis((before + after) / 2 @ jacobian.T, 2, 0)
    sets = datasets(
        [0 * speed, *np.moveaxis(before, 2, 0), *np.moveaxis(commands, 2, 0)],
        [
            *arc(speed, yaw_rate, offset),
            (after @ jacobian.T)[..., 1],
            *np.moveaxis(after, 2, 0),
        ],
    )
    model = identify(sets, SKID, "rotation_centres").model
    assert np.allclose(model.jacobian, jacobian, atol=1e-4)
    assert float(model.centre_offset) == pytest.approx(offset, abs=1e-4)
    ideal = identify(sets, SKID, "differential_drive")
    assert mean_loss(model, sets.test) < 1e-5 < 1e-3 < ideal.best_test_loss


def car(rng, length=2.5, gain=6.0, offset=0.8):
    """A car whose throttle sets its speed, and whose pose is ahead of its rear axle."""
    commands = held_commands(rng, 24, 20, 2) * (1.0, 0.5)
    before, after = (part[..., 0] for part in lagged(gain * commands[..., :1]))
    steering = commands[..., 1]
    curvature = np.tan(steering) / length
    middle = (before + after) / 2
    motion = arc(middle, middle * curvature, offset)
    yaw_rate = rng.normal(size=before.shape)  # of the step before, which says nothing
    inputs = [before, yaw_rate, commands[..., 0], steering]
    return inputs, [*motion, after, after * curvature]


@pytest.mark.parametrize("pose", ["planar", "spatial", "none"])
def test_a_bicycle_finds_wheelbase_and_throttle(rng, pose):
    """The turn is about z; what rises and tilts is the mean."""
    inputs, (forward, left, turn, *columns) = car(rng)
    half = [0 * turn + 0.01, 0 * turn, 0 * turn, np.sin(turn / 2), np.cos(turn / 2)]
    changes = {"planar": [forward, left, turn], "spatial": [forward, left, *half]}
    sets = datasets(inputs, [*changes.get(pose, []), *columns])
    trained = identify(sets, replace(CAR, pose=pose), "ackermann")
    model = trained.model
    assert trained.best_test_loss < 1e-4
    assert float(model.jacobian[1, 1]) == pytest.approx(1 / 2.5, abs=1e-3)
    assert float(model.decay[0]) == pytest.approx(LAG, abs=1e-3)
    assert float(model.push[0, 0]) == pytest.approx(6.0 * LAG, abs=1e-2)
    if pose != "none":
        assert float(model.centre_offset) == pytest.approx(0.8, abs=1e-3)
    if pose == "spatial":
        assert np.allclose(model.rest, [0.01, 0.0, 0.0], atol=1e-6)


@pytest.mark.parametrize(
    "body, model, kind, first, second",
    [
        (SKID, "rotation_centres", "sides", ((1,), True), ((2,), True)),
        (FOUR_WHEELS, "differential_drive", "sides", ((1, 3), True), ((0, 2), True)),
        (TWIST, "rotation_centres", "twist", ((0,), True), ((1,), True)),
        (CAR, "ackermann", "steered", ((0,), True), ((1,), False)),
        (ROVER, "ackermann", "steered", ((0,), True), ((1,), False)),
        # a measured twist serves both kinds of robot
        (CAR, "rotation_centres", "twist", ((0,), True), ((1,), True)),
    ],
)
def test_signals_are_found_by_names(body, model, kind, first, second):
    found = drivetrain_of(body, model)
    assert found.kind == kind
    assert [found.first, found.second] == [first, second]


def test_commands_stand_for_what_is_not_measured():
    body = replace(SKID, columns=(), actions=(("Left_Motor", "1"), ("right", "1")))
    found = drivetrain_of(body, "differential_drive")
    assert found.first == Signal((0,), False) and found.followed == {}
    assert drivetrain_of(SKID, "rotation_centres").followed == {1: 0, 2: 1}
    columns = (("v", "V"), ("w", "W"), *SKID.columns)  # a voltage is no speed
    found = drivetrain_of(replace(SKID, columns=columns), "rotation_centres")
    assert (found.speed, found.yaw_rate, found.first.indices) == (None, 2, (3,))


ARM = replace(planar("arm", {"q": "rad"}, {"u": "1"}), pose="none")
BENCH = replace(planar("bench", WHEELS, {"u": "1"}), pose="none")


def test_a_body_without_the_columns_is_refused_in_a_line():
    for body, model, words in (
        (SKID, "ackermann", "looks for a speed .* and 'steering'; body 'skid' has"),
        (ARM, "differential_drive", "'left' and 'right' in .*columns q and actions"),
        (BENCH, "rotation_centres", "looks for a pose, a speed or a yaw rate"),
    ):
        with pytest.raises(ConfigError, match=words) as refusal:
            drivetrain_of(body, model)
        assert "\n" not in str(refusal.value)


@pytest.mark.more
def test_the_hunters_wheelbase_is_in_its_drives():
    """The maker gives 0.65 m; model and recordings agree to 15 %."""
    drives = ownrobot.read_drives(
        RECORDINGS / "hunter.csv.gz", body=RECORDINGS / "hunter.yaml"
    )
    model = ownrobot.fit(drives, method="ackermann", test=0.25)
    speed, turning = model.predictor.jacobian.diag().tolist()
    assert speed / turning == pytest.approx(0.65, rel=0.15)
    assert model.held_out.loss < 0.4 * model.held_out.mean_loss
