"""CSV files that other programs write of a robot's topics."""

import numpy as np
import pytest

from ownrobot.recordings import guess_body, read_drives
from ownrobot.recordings.exports import read_text

TIME = np.arange(0, 20, 0.1)  # s
RATE, SPEED = 0.5 * np.sin(0.4 * TIME), 0.6 + 0.2 * np.sin(0.3 * TIME)
YAW = np.r_[0, np.cumsum(RATE[:-1]) * 0.1]
BODY = {
    "name": "cart",
    "pose": "planar",
    "columns": {"vx": "m/s", "yaw_rate": "rad/s", "left_wheel": "rad/s"},
    "actions": {"linear": "m/s", "angular": "rad/s"},
}
ODOMETRY = {
    "/odom/pose/pose/position/x": np.cumsum(SPEED * np.cos(YAW)) * 0.1,
    "/odom/pose/pose/position/y": np.cumsum(SPEED * np.sin(YAW)) * 0.1,
    "/odom/pose/pose/orientation/x": 0 * TIME,
    "/odom/pose/pose/orientation/y": 0 * TIME,
    "/odom/pose/pose/orientation/z": np.sin(YAW / 2),
    "/odom/pose/pose/orientation/w": np.cos(YAW / 2),
    "/odom/twist/twist/linear/x": SPEED,
    "/odom/twist/twist/angular/z": RATE + 0.1,  # is not that of the gyro
}
OTHERS = {
    "/imu/angular_velocity/z": RATE,
    "/joint_states/left_wheel/velocity": 8 * SPEED,
    "/cmd_vel/linear/x": 1.1 * SPEED,
    "/cmd_vel/angular/z": 1.2 * RATE,
}


@pytest.fixture
def write(tmp_path):
    def write(columns):
        path = tmp_path / "export.csv"
        lines = [
            ",".join(columns),
            *(
                ",".join(map(repr, row))
                for row in zip(
                    *(map(float, values) for values in columns.values()), strict=True
                )
            ),
        ]
        path.write_text("\n".join(lines) + "\n")
        return path

    return write


@pytest.mark.parametrize("dots", [False, True])
def test_paths_in_messages_are_read_as_parts_of_a_bag(write, dots):
    columns = {"__time": 1.7e9 + TIME} | ODOMETRY | OTHERS
    if dots:
        columns = {n.strip("/").replace("/", "."): c for n, c in columns.items()}
    path = write(columns)
    (drive,) = read_drives(path, BODY)
    assert np.allclose(np.unwrap(drive.states[:, 2]), YAW, atol=1e-6)
    assert np.allclose(drive.states[:, 3:], np.c_[SPEED, RATE, 8 * SPEED])
    assert np.allclose(drive.actions, np.c_[1.1 * SPEED, 1.2 * RATE][:-1])
    guess = guess_body(path).body
    assert guess.actions == (("linear", "m/s"), ("angular", "rad/s"))
    assert guess.pose == "planar" and ("yaw_rate", "rad/s") in guess.columns


def test_paths_that_mean_the_same_keep_their_names(write):
    again = {f"/map{name}": values for name, values in ODOMETRY.items()}
    text = read_text(write({"time [s]": TIME} | ODOMETRY | again | OTHERS))
    assert "x" not in text.names and "/odom/pose/pose/position/x" in text.names
    assert text.names[-3:] == ["left_wheel", "linear", "angular"]


def test_topics_of_one_number_are_named_after_the_topic(write):
    text = read_text(write({"%time": 1e9 * TIME, "/cmd_left/data": SPEED}))
    assert (text.names, text.units) == (["time", "cmd_left"], ["ns", ""])
