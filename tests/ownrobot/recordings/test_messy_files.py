"""Files as they come: damaged, jittery, in subfolders, about to be overwritten."""

import gzip

import numpy as np
import pytest

import ownrobot
from ownrobot import __main__ as command_line
from ownrobot.body_file import read_body
from ownrobot.recordings import RecordingError, read_drives
from sidm.config import ConfigError, Notice

BODY = """
name: cart
pose: planar
columns: {speed: m/s}
actions: {throttle: 1, heading: rad}
"""
HEADER = "time [s],x [m],y [m],yaw [rad],speed [m/s],throttle [1],heading [rad]"


def lines(time, throttle, heading, seed=0):
    """A drive along x whose speed follows the throttle."""
    rng = np.random.default_rng(seed)
    speed = 0.5 + 0.2 * throttle + 0.01 * rng.standard_normal(len(time))
    x = np.cumsum(speed * np.gradient(time))
    columns = time, x, 0 * x, 0 * x, speed, throttle, heading
    rows = [",".join(f"{v:.9g}" for v in row) for row in zip(*columns, strict=True)]
    return "\n".join([HEADER, *rows, ""])


@pytest.fixture
def folder(tmp_path):
    """A folder of four drives at 20 Hz, and the body beside it."""
    (tmp_path / "robot.yaml").write_text(BODY)
    (tmp_path / "drives").mkdir()
    for number in range(4):
        rng = np.random.default_rng(number)
        time = 0.05 * np.arange(400)
        throttle = np.repeat(rng.uniform(-1, 1, 40), 10)
        text = lines(time, throttle, 0.1 * throttle, number)
        (tmp_path / "drives" / f"{number}.csv").write_text(text)
    return tmp_path


def test_a_recording_in_a_folder_is_not_overwritten(folder, monkeypatch, capsys):
    monkeypatch.chdir(folder)
    fit = "fit --novice drives --body robot.yaml --out model"
    assert command_line.main(fit.split()) == 0
    before = (folder / "drives" / "0.csv").read_text()
    for words in (
        "predict model drives --out drives/0.csv",
        "evaluate model drives --csv drives/0.csv",
    ):
        assert command_line.main(words.split()) == 2
        assert "drives/0.csv is read, too" in capsys.readouterr().err
    assert (folder / "drives" / "0.csv").read_text() == before


def test_a_row_that_is_a_little_late_is_of_its_step(folder):
    """Times with jitter give the commands of exact times."""
    time = 0.05 * np.arange(200)
    throttle = np.repeat([0.0, 1.0, -1.0, 0.5], 50)
    late = time + np.random.default_rng(0).uniform(0, 4e-3, 200) * (time > 0)
    found = []
    for name, times in (("exact", time), ("late", late)):
        path = folder / f"{name}.csv"
        path.write_text(lines(times, throttle, 0.1 * throttle))
        (drive,) = read_drives(path, folder / "robot.yaml")
        found.append(drive.actions[:98])
    assert np.array_equal(*found)


def test_commands_of_an_angle_are_averaged_around_the_circle(folder):
    time = 0.05 * np.arange(200)
    heading = np.where(np.arange(200) % 2, 3.1, -3.1) + 0.02 * np.sin(time)
    path = folder / "circle.csv"
    path.write_text(lines(time, np.sin(time), heading))
    (drive,) = read_drives(path, folder / "robot.yaml")
    assert np.abs(np.cos(drive.actions[:, 1]) + 1).max() < 1e-3


def test_a_damaged_archive_is_one_line(folder):
    data = bytearray(gzip.compress((folder / "drives" / "0.csv").read_bytes()))
    data[len(data) // 2 : len(data) // 2 + 40] = bytes(40)
    path = folder / "damaged.csv.gz"
    path.write_bytes(data)
    with pytest.raises(RecordingError, match="cannot be read as text") as caught:
        read_drives(path, folder / "robot.yaml")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("time", "words"),
    [
        (0.1 * (np.arange(40) // 2), "has the same time as the row before it"),
        (4 - 0.1 * np.arange(40), "before the row before it"),
    ],
)
def test_times_of_which_no_body_can_be_guessed_are_one_line(
    folder, time, words, monkeypatch, capsys
):
    monkeypatch.chdir(folder)
    rising = 0.1 * np.arange(40)
    text = lines(rising, np.sin(rising), np.cos(rising)).splitlines()
    rows = [
        f"{t:.3g},{row.partition(',')[2]}"
        for t, row in zip(time, text[1:], strict=True)
    ]
    text = [text[0].replace("throttle", "command"), *rows]
    (folder / "odd.csv").write_text("\n".join(text))
    assert command_line.main(["body", "odd.csv"]) == 1
    said = capsys.readouterr().err
    assert words in said and said.count("\n") == 1


def test_files_of_a_folder_that_are_not_read_are_noted(folder):
    day = folder / "drives" / "day1"
    day.mkdir()
    (day / "a.csv").write_text((folder / "drives" / "0.csv").read_text())
    (folder / "drives" / "B.CSV").write_text("")
    with pytest.warns(Notice, match="drives: 2 files are not read, as .*B.CSV"):
        assert len(read_drives(folder / "drives", folder / "robot.yaml")) == 4


def test_a_percent_sign_needs_quotation_marks(tmp_path):
    path = tmp_path / "robot.yaml"
    path.write_text(BODY.replace("throttle: 1", "throttle: %"))
    with pytest.raises(ConfigError, match="write a unit of % as '%'"):
        read_body(path)
    path.write_text(BODY.replace("throttle: 1", "throttle: '%'"))
    assert read_body(path).actions[0] == ("throttle", "%")


def test_an_experts_body_needs_an_expert(folder):
    drives = read_drives(folder / "drives", folder / "robot.yaml")
    with pytest.raises(ConfigError, match="expert_body is given"):
        ownrobot.compare(drives, methods=["mean"], expert_body=folder / "robot.yaml")
