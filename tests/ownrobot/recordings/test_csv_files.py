"""CSV files as loggers, spreadsheets and programs that export topics write them."""

import lzma

import numpy as np
import pytest

from ownrobot.recordings import (
    RecordingError,
    RecordingWarning,
    guess_body,
    read_drives,
)
from ownrobot.recordings.csv_file import read_text
from tests.ownrobot.cart import CART

TIME = 0.05 * np.arange(200)
TURN, SPEED = 0.5 * np.sin(0.4 * TIME), 0.6 + 0.2 * np.sin(0.3 * TIME)
YAW = np.r_[0, np.cumsum(TURN[:-1])] * 0.05
X, Y = (np.cumsum(SPEED * part(YAW)) * 0.05 for part in (np.cos, np.sin))
MOTION = {
    "x [m]": X,
    "y [m]": Y,
    "yaw [rad]": YAW,
    "speed [m/s]": SPEED,
    "throttle": np.cos(TIME),
}


def csv(columns, separator=",", end="", head="") -> str:
    """A file of columns: names, and numbers or texts."""
    cells = [
        [v if isinstance(v, str) else f"{v:.9f}" for v in values]
        for values in columns.values()
    ]
    rows = [separator.join(row) + end for row in zip(*cells, strict=True)]
    return head + "\n".join([separator.join(columns), *rows]) + "\n"


def timed(name, times, **how) -> bytes:
    return csv({name: list(times)} | MOTION, **how).encode()


PLAIN = timed("time [s]", (f"{t:.2f}" for t in TIME)).decode()
#: A column that nothing reads, whose texts have points (here `#`), and quaternions.
DATED = {"time [s]": list(TIME), "Datum": ["01#05#2024"] * 200}
WHOLE = [str(1_403_636_580_838_555_648 + 50_000_000 * n) for n in range(200)]
PAIRS = [f"{1_700_000_000 + n // 20},{n % 20 * 50_000_000}" for n in range(200)]


@pytest.mark.parametrize(
    "name, content",
    [
        ("a.csv", timed("time [s]", TIME, separator=";", head="sep=;\n")),
        ("a.csv", timed("time [s]", TIME, separator=";").replace(b".", b",")),
        ("a.csv", timed("time [s]", TIME, separator="\t").replace(b".", b",")),
        ("a.csv", b"\xef\xbb\xbf" + timed("time [s]", TIME)),
        ("a.csv", timed("time [s]", TIME, end=",")),
        ("a.csv", timed("time [s]", TIME, head="# Logger v2.1\n# Date: today\n\n")),
        ("a.csv", PLAIN.replace("\n0.50,", "\n# a mark\n\n0.50,").encode()),
        ("A.CSV", PLAIN.encode()),
        ("a.csv", PLAIN.encode("utf-16")),
        ("a.csv.xz", lzma.compress(PLAIN.encode())),
        ("a.csv", timed("#timestamp [ns]", WHOLE)),
        ("a.csv", timed("sec,nanosec", PAIRS)),
        ("a.csv", timed("stamp.secs,stamp.nsecs", PAIRS)),
        ("a.csv", timed("time [ms]", 1000 * TIME)),
        ("a.csv", timed("time [us]", (f"{1.7e15 + 1e6 * t:.1f}" for t in TIME))),
        ("a.csv", csv(MOTION, ";", head="# rate: 20 Hz;;;;\n").encode()),
        (
            "a.csv",
            csv(DATED | MOTION, ";").replace(".", ",").replace("#", ".").encode(),
        ),
    ],
)
def test_a_loggers_file_has_the_same_drive(tmp_path, name, content):
    (tmp_path / name).write_bytes(content)
    (drive,) = read_drives(tmp_path / name, CART)
    *states, throttle = MOTION.values()
    assert np.allclose(drive.states, np.transpose(states)[::2], atol=1e-6)
    means = (throttle[:-2:2] + throttle[1:-2:2]) / 2
    assert np.allclose(drive.actions[:, 0], means, atol=1e-6)


def test_a_row_that_a_power_failure_cut_is_left_out(tmp_path):
    (tmp_path / "a.csv").write_text(PLAIN[:-40])
    with pytest.warns(RecordingWarning, match="the last line is cut off"):
        (drive,) = read_drives(tmp_path / "a.csv", CART)
    assert len(drive) == 99


SPARSE = MOTION | {name: [""] * 200 for name in ("x [m]", "y [m]", "yaw [rad]")}


@pytest.mark.parametrize(
    "content, words",
    [
        (PLAIN.replace("1.000000000", "1,500.5", 1), "line 2 has 7 cells, not 6"),
        (
            csv({"time [s]": TIME} | MOTION, "\t").replace("\t1.0", "\t1,000.0"),
            "remove commas between thousands",
        ),
        (timed("time [s]", 1000 * TIME).decode(), "is 'time' in ms"),
        (
            timed("time [s]", ["2024-05-01"] * 200).decode(),
            "export times as numbers of s",
        ),
        (PLAIN.replace("yaw [rad]", "yaw [deg]"), "called degrees"),
        (csv({"time [s]": TIME} | SPARSE), "several rates are exported together"),
    ],
)
def test_what_is_wrong_is_said_with_a_mend(tmp_path, content, words):
    (tmp_path / "a.csv").write_text(content)
    with pytest.raises(RecordingError, match=words):
        read_drives(tmp_path / "a.csv", CART)


BODY = {
    "name": "cart",
    "pose": "planar",
    "columns": {"vx": "m/s", "yaw_rate": "rad/s", "left_wheel": "rad/s"},
    "actions": {"linear": "m/s", "angular": "rad/s"},
}
ODOMETRY = {
    "/odom/pose/pose/position/x": X,
    "/odom/pose/pose/position/y": Y,
    "/odom/pose/pose/orientation/x": 0 * TIME,
    "/odom/pose/pose/orientation/y": 0 * TIME,
    "/odom/pose/pose/orientation/z": np.sin(YAW / 2),
    "/odom/pose/pose/orientation/w": np.cos(YAW / 2),
    "/odom/twist/twist/linear/x": SPEED,
    "/odom/twist/twist/angular/z": TURN + 0.1,  # is not that of the gyro
}
OTHERS = {
    "/imu/angular_velocity/z": TURN,
    "/joint_states/left_wheel/velocity": 8 * SPEED,
    "/cmd_vel/linear/x": 1.1 * SPEED,
    "/cmd_vel/angular/z": 1.2 * TURN,
}


@pytest.mark.parametrize("dots", [False, True])
def test_paths_in_messages_are_read_as_parts_of_a_bag(tmp_path, dots):
    columns = {"__time": 1.7e9 + TIME} | ODOMETRY | OTHERS
    if dots:
        columns = {n.strip("/").replace("/", "."): c for n, c in columns.items()}
    path = tmp_path / "export.csv"
    path.write_text(csv(columns))
    (drive,) = read_drives(path, BODY)
    assert np.allclose(np.unwrap(drive.states[:, 2]), YAW[::2], atol=1e-6)
    assert np.allclose(drive.states[:, 3:], np.c_[SPEED, TURN, 8 * SPEED][::2])
    commands = np.c_[1.1 * SPEED, 1.2 * TURN]
    assert np.allclose(drive.actions, (commands[:-2:2] + commands[1:-2:2]) / 2)
    guess = guess_body(path).body
    assert guess.actions == (("linear", "m/s"), ("angular", "rad/s"))
    assert guess.pose == "planar" and ("yaw_rate", "rad/s") in guess.columns


def test_paths_that_mean_the_same_keep_their_names_and_others_lose_them(tmp_path):
    again = {f"/map{name}": values for name, values in ODOMETRY.items()}
    columns = {"%time": 1e9 * TIME, "/cmd_left/data": SPEED} | ODOMETRY | again | OTHERS
    (tmp_path / "a.csv").write_text(csv(columns))
    text = read_text(tmp_path / "a.csv")
    assert "x" not in text.names and "/odom/pose/pose/position/x" in text.names
    assert text.names[-3:] == ["left_wheel", "linear", "angular"]
    assert (text.names[:2], text.units[:2]) == (["time", "cmd_left"], ["ns", ""])
