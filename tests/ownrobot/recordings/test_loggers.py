"""Files as loggers and spreadsheets write them, and yaws that are none."""

import lzma

import numpy as np
import pytest

from ownrobot.recordings import RecordingError, RecordingWarning, read_drives
from ownrobot.recordings.headings import yaw_fault
from sidm.config import replace
from sidm.drives import Drive
from tests.ownrobot.cart import CART

ROWS = 60
TIME = 0.05 * np.arange(ROWS)
COLUMNS = np.stack(
    [np.sin(TIME), 1 - np.cos(TIME), TIME, 1 + 0.1 * np.sin(5 * TIME), np.cos(TIME)]
)
NAMES = ["x [m]", "y [m]", "yaw [rad]", "speed [m/s]", "throttle"]


def text(times, names=("time [s]",), separator=",", end="", head="") -> str:
    """A drive on a circle as CSV text."""
    lines = [separator.join([*names, *NAMES])]
    for time, row in zip(times, COLUMNS.T, strict=True):
        numbers = separator.join(f"{value:.9f}" for value in row)
        lines.append(f"{time}{separator}{numbers}{end}")
    return head + "\n".join(lines) + "\n"


SECONDS = [f"{time:.2f}" for time in TIME]
NANOSECONDS = [str(1_403_636_580_838_555_648 + 50_000_000 * n) for n in range(ROWS)]
PAIRS = [f"{1_700_000_000 + n // 20},{n % 20 * 50_000_000}" for n in range(ROWS)]
PLAIN = text(SECONDS)


@pytest.mark.parametrize(
    "name, content",
    [
        ("a.csv", text(SECONDS, separator=";", head="sep=;\n").encode()),
        ("a.csv", text(SECONDS, end=",").encode()),
        ("a.csv", text(SECONDS, head="# Logger v2.1\n# Date: today\n\n").encode()),
        ("a.csv", PLAIN.replace("\n0.50,", "\n# a mark\n\n0.50,").encode()),
        ("A.CSV", PLAIN.encode()),
        ("a.csv", PLAIN.encode("utf-16")),
        ("a.csv.xz", lzma.compress(PLAIN.encode())),
        ("a.csv", text(NANOSECONDS, ["time [ns]"]).encode()),
        ("a.csv", text(NANOSECONDS, ["#timestamp [ns]"]).encode()),
        ("a.csv", text(PAIRS, ["sec,nanosec"]).encode()),
        ("a.csv", text(PAIRS, ["stamp.secs,stamp.nsecs"]).encode()),
        ("a.csv", text([f"{1000 * t:.0f}" for t in TIME], ["time [ms]"]).encode()),
    ],
)
def test_a_loggers_file_has_the_same_drive(tmp_path, name, content):
    (tmp_path / "plain.csv").write_text(PLAIN)
    (tmp_path / name).write_bytes(content)
    (plain,) = read_drives(tmp_path / "plain.csv", CART)
    (drive,) = read_drives(tmp_path / name, CART)
    assert np.allclose(drive.states, plain.states, atol=1e-6)
    assert np.allclose(drive.actions, plain.actions, atol=1e-6)
    assert len(drive) == 29 and drive.states[10, 0] == pytest.approx(np.sin(1.0))


def test_a_row_that_a_power_failure_cut_is_left_out(tmp_path):
    (tmp_path / "a.csv").write_text(PLAIN[:-40])
    with pytest.warns(RecordingWarning, match="the last line is cut off"):
        (drive,) = read_drives(tmp_path / "a.csv", CART)
    assert len(drive) == 29


@pytest.mark.parametrize(
    "content, words",
    [
        (PLAIN.replace("0.500000000", "1,500.5", 1), "not 6"),
        (
            text(SECONDS, separator="\t").replace("\t1.0", "\t1,000.0"),
            "remove commas between thousands",
        ),
        (text(SECONDS, separator="\t").replace("\t1.0", "\t1,000"), "thousands"),
        (text([1000 * t for t in TIME]), "is 'time' in ms"),
        (text([*SECONDS[:30], *SECONDS[10:40]]), "cut the file there"),
        (text([*SECONDS[:30], *SECONDS[29:59]]), "leave one of them out"),
        (PLAIN.replace("yaw [rad]", "yaw [deg]"), "called degrees"),
    ],
)
def test_what_is_wrong_is_said_with_a_mend(tmp_path, content, words):
    (tmp_path / "a.csv").write_text(content)
    with pytest.raises(RecordingError, match=words):
        read_drives(tmp_path / "a.csv", CART)


def test_topics_of_several_rates_are_named(tmp_path):
    lines = PLAIN.splitlines()
    sparse = [lines[0], *(line.split(",")[0] + ",,,,,1" for line in lines[1:])]
    (tmp_path / "a.csv").write_text("\n".join(sparse))
    with pytest.raises(RecordingError, match="several rates are exported together"):
        read_drives(tmp_path / "a.csv", CART)


def weaving(yaw_of, steps=400, wide=2.0) -> Drive:
    """A drive in all directions, with a yaw that is a function of the true one."""
    yaw = wide * np.cumsum(np.sin(0.07 * np.arange(steps + 1))) / 10
    x, y = (np.cumsum(0.1 * part(yaw)) for part in (np.cos, np.sin))
    states = np.stack([x, y, yaw_of(yaw), np.ones(steps + 1)], 1)
    return Drive(states, np.ones((steps, 1)), CART)


@pytest.mark.parametrize(
    "yaw_of, words",
    [
        (lambda yaw: yaw, ""),
        (lambda yaw: yaw + np.pi, ""),  # it drives backwards
        (lambda yaw: yaw + 0.8, "45 degrees off"),
        (lambda yaw: -yaw, "turned to the right"),
        (lambda yaw: np.pi / 2 - yaw, "turned to the right"),  # a compass
        (lambda yaw: 0 * yaw, "hardly changes"),
        (lambda yaw: 1 + 0.02 * np.sin(30 * yaw), "hardly changes"),
        (np.degrees, "in degrees"),
        (lambda yaw: np.degrees(-yaw), ""),  # two faults at once are not told apart
        (np.radians, "called degrees"),
    ],
)
def test_the_yaw_of_all_drives_is_held_against_their_directions(yaw_of, words):
    fault = yaw_fault([weaving(yaw_of)] * 3, CART)
    assert words in fault and bool(words) == bool(fault)


def test_what_tells_nothing_of_the_yaw_is_no_fault():
    one_way = weaving(lambda yaw: 0 * yaw, wide=0.02)
    assert yaw_fault([one_way], CART) == ""
    sideways = replace(CART, columns=(("vy", "m/s"),))
    drive = replace(weaving(lambda yaw: 0 * yaw), body=sideways)
    assert yaw_fault([drive], sideways) == ""
