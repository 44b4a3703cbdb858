"""The commands `ownrobot check` and `ownrobot body`, and the functions behind them."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from ownrobot.__main__ import main
from ownrobot.body_file import read_body
from ownrobot.fitting.arguments import drives_from
from ownrobot.recordings import (
    RecordingError,
    guess_body,
    inspect_drives,
    read_drives,
)
from tests.ownrobot.recordings.test_bad_input import BODY, put, text
from tests.ownrobot.recordings.test_bags import make_bag  # noqa: F401

ROOT = Path(__file__).parents[3] / "recordings"


@pytest.fixture
def warthog(tmp_path, monkeypatch):
    """A folder with the Warthog's recording and its body, which is the current one."""
    shutil.copy(ROOT / "warthog.csv.gz", tmp_path)
    shutil.copy(ROOT / "skid_steer.yaml", tmp_path / "robot.yaml")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_check_says_what_is_there_and_what_is_wrong(warthog, capsys):
    assert main(["check", "warthog.csv.gz", "--body", "robot.yaml"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == (
        "warthog.csv.gz: 287 drives without a fault of 96 sessions, 9.09 min"
    )
    assert "rows come at 20 Hz, and the body has 10 Hz" in lines[1]
    assert lines[2].split() == ["column", "unit", "min", "median", "max", "std"]
    assert [line.split()[:2] for line in lines[3:7]] == [
        ["x", "m"],
        ["y", "m"],
        ["yaw", "rad"],
        ["yaw_rate", "rad/s"],
    ]
    assert lines[11].startswith("note: warthog.csv.gz: 2 of 167 drives do not move")
    assert lines[12].startswith("nothing would be refused")
    options = ["--body", "robot.yaml", "--skip-bad"]
    assert main(["check", "warthog.csv.gz", *options]) == 0
    out = capsys.readouterr().out
    assert out.startswith("warthog.csv.gz: 285 drives")
    assert "left out: warthog.csv.gz drive 22/0: it moves 79 degrees off" in out


def test_check_fails_where_fit_would(tmp_path, capsys):
    (tmp_path / "a.csv").write_text(text())
    (tmp_path / "b.csv").write_text(put(10, 3, "fast"))
    (tmp_path / "cart.yaml").write_text(
        "pose: planar\ncolumns: {wheel: rad/s}\nactions: {throttle: '%'}\n"
    )
    options = [str(tmp_path), "--body", str(tmp_path / "cart.yaml")]
    assert main(["check", *options]) == 1
    lines = capsys.readouterr().out.splitlines()
    assert lines[-2].startswith(f"wrong: {tmp_path / 'b.csv'}: line 10: 'fast'")
    assert lines[-1] == "--skip-bad leaves out each drive or file that is wrong"
    assert main(["check", *options, "--skip-bad"]) == 0
    assert f"left out: {tmp_path / 'b.csv'}" in capsys.readouterr().out


def test_a_guessed_body_reads_the_recording(warthog, capsys):
    assert main(["body", "warthog.csv.gz", "--out", "guess.yaml"]) == 0
    assert (
        capsys.readouterr().out == "guess.yaml: check it, then run 'ownrobot check'\n"
    )
    guess, body = read_body("guess.yaml"), read_body("robot.yaml")
    assert (guess.state, guess.actions) == (body.state, body.actions)
    assert (guess.pose, guess.rate, guess.name) == ("planar", 10, "warthog")
    assert main(["body", "warthog.csv.gz"]) == 0
    assert capsys.readouterr().out == Path("guess.yaml").read_text()
    assert main(["body", "warthog.csv.gz", "--out", "guess.yaml"]) == 2
    assert "guess.yaml: there is such a file" in capsys.readouterr().err


def test_check_of_a_bag_whose_body_was_guessed(
    make_bag,  # noqa: F811
    tmp_path,
    capsys,
):
    bag, body = make_bag(2, twice="/other"), tmp_path / "robot.yaml"
    topics = ["--topics", "/odom", "/cmd_vel"]
    assert main(["body", str(bag), "--out", str(body)]) == 1
    assert "name those that are meant with --topics" in capsys.readouterr().err
    assert main(["body", str(bag), *topics, "--out", str(body)]) == 0
    assert main(["check", str(bag), "--body", str(body), *topics]) == 0
    out = capsys.readouterr().out
    assert "1 drives without a fault of 1 sessions" in out
    assert out.endswith("nothing is wrong\n")


def test_all_faults_are_named_and_not_only_the_first(tmp_path):
    (tmp_path / "a.csv").write_text(text())
    (tmp_path / "b.csv").write_text(put(10, 3, "fast"))
    (tmp_path / "c.csv").write_text(text(count=9))
    found = inspect_drives(tmp_path, BODY)
    assert found["drives"] == 1 and found["steps"] == [20, 20, 20]
    assert found["row_rate"] == pytest.approx(20) and found["body_rate"] == 10
    first, second = found["faults"]
    assert "b.csv: line 10" in first and "c.csv: 4 steps of 0.1 s" in second
    wheel = found["columns"][3]
    assert (wheel["name"], wheel["unit"]) == ("wheel", "rad/s")
    assert (wheel["min"], wheel["max"]) == (5, pytest.approx(6, abs=0.01))
    assert json.loads(json.dumps(found)) == found  # plain data
    (tmp_path / "a.csv").unlink()
    found = inspect_drives(tmp_path, BODY)
    assert (found["drives"], found["columns"], found["steps"]) == (0, [], None)
    assert len(found["faults"]) == 2


def test_faults_of_all_drives_together_are_named(tmp_path):
    path = tmp_path / "drive.csv"
    lines = text().splitlines()
    lines[2:] = [f"{line.rpartition(',')[0]},7" for line in lines[2:]]
    path.write_text("\n".join(lines) + "\n")
    found = inspect_drives(path, BODY)
    assert found["common_faults"] == [
        f"{path}: 'throttle' never changes; mend it, or leave it out of the body"
    ]
    with pytest.raises(RecordingError, match="no command changes; record drives"):
        guess_body(path)


def test_a_guess_says_what_it_leaves_out(tmp_path):
    path = tmp_path / "my drive.csv"
    names = "stamp,x [m],y [m],yaw [deg],battery [%],no,label,2nd,motor [A],cmd_a [V]"
    time = np.arange(60) / 4
    rows = [
        f"{t},{t},{t / 100},{t},50,{1 + t % 1},on,1,{t % 3},{np.sin(t)}" for t in time
    ]
    path.write_text("\n".join(["# rate: 4 Hz", names, *rows]) + "\n")
    guess = guess_body(path)
    (tmp_path / "robot.yaml").write_text(guess.text)
    assert read_body(tmp_path / "robot.yaml") == guess.body
    assert guess.body.columns == (("no", "1"), ("motor", "A"))
    assert guess.body.actions == (("cmd_a", "V"),)
    assert (guess.body.name, guess.body.rate) == ("my drive", 4)
    assert guess.left_out == {
        "stamp": "it seems to count rows or time",
        "battery": "it never changes",
        "label": "it has cells without a number",
        "2nd": "rename it: each name once, of letters, digits and _",
    }
    assert len(read_drives(path, tmp_path / "robot.yaml")) == 1


def test_a_guess_says_what_reading_finds(tmp_path):
    """The pose has no unit, which reading does not take."""
    path = tmp_path / "drive.csv"
    path.write_text(text().replace("x [m]", "x"))
    assert guess_body(path).notes[-1] == (
        f"reading says: {path}: 'x' without a unit; a length is in m or cm or mm"
    )


def test_a_file_without_a_command_gives_no_body(tmp_path):
    path = tmp_path / "drive.csv"
    path.write_text(text().replace("throttle", "gas"))
    with pytest.raises(RecordingError, match="no column seems to be a command"):
        guess_body(path)


def test_several_files_are_read_together(tmp_path):
    """A command that changes in one file alone is no fault of the other."""
    first, second = tmp_path / "a.csv", tmp_path / "b.csv"
    lines = text().splitlines()
    first.write_text("\n".join(lines) + "\n")
    held = [f"{line.rpartition(',')[0]},7" for line in lines[2:]]
    second.write_text("\n".join([*lines[:2], *held]) + "\n")
    paths = [str(first), str(second)]
    drives = drives_from(paths, BODY, "novice")
    assert [drive.name for drive in drives] == [f"{path} drive 0" for path in paths]
    with pytest.raises(RecordingError, match="b.csv: 'throttle' never changes"):
        drives_from(second, BODY, "novice")
    assert len(drives_from(paths, BODY, "expert", topics=["/odom"])) == 2
    with pytest.raises(RecordingError, match="leave --topics out"):
        drives_from(paths, BODY, "novice", topics=["/odom"])
