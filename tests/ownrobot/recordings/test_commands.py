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
    RecordingWarning,
    guess_body,
    inspect_drives,
    read_drives,
)
from sidm.config import ConfigError
from tests.ownrobot.recordings.test_bags import make_bag  # noqa: F401
from tests.ownrobot.recordings.test_reading import BODY, circle, put, text, timed

ROOT = Path(__file__).parents[3] / "recordings"
HELD = text(circle() * [1, 1, 1, 1, 1, 0])  # the command never changes


@pytest.fixture
def warthog(tmp_path, monkeypatch):
    shutil.copy(ROOT / "warthog.csv.gz", tmp_path)
    shutil.copy(ROOT / "skid_steer.yaml", tmp_path / "robot.yaml")
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    (tmp_path / "drives").mkdir()
    contents = {"a": text(), "b": put(10, 4, "fast"), "c": text(circle(9))}
    for name, content in contents.items():
        (tmp_path / "drives" / f"{name}.csv").write_text(content)
    (tmp_path / "cart.yaml").write_text(
        "pose: planar\ncolumns: {yaw_rate: rad/s, wheel: rad/s}\n"
        "actions: {throttle: '%'}\n"
    )
    monkeypatch.chdir(tmp_path)


def test_check_says_what_is_there_and_what_is_wrong(warthog, capsys):
    assert main(["check", "warthog.csv.gz", "--body", "robot.yaml"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == (
        "warthog.csv.gz: 287 drives without a fault of 96 sessions, 9.09 min"
    )
    assert "rows come at 20 Hz, and the body has 10 Hz" in lines[1]
    assert lines[6].split()[:2] == ["yaw_rate", "rad/s"]
    assert lines[11].startswith("note: warthog.csv.gz: 2 of 167 drives do not move")
    assert lines[12].startswith("nothing would be refused")
    assert main(["check", "warthog.csv.gz", "--body", "robot.yaml", "--skip-bad"]) == 0
    out = capsys.readouterr().out
    assert out.startswith("warthog.csv.gz: 285 drives")
    assert "left out: warthog.csv.gz drive 22/0: it moves 79 degrees off" in out


def test_check_fails_where_fit_would_and_names_all_faults(folder, capsys):
    options = ["drives", "--body", "cart.yaml"]
    assert main(["check", *options]) == 1
    lines = capsys.readouterr().out.splitlines()
    assert lines[-3].startswith("wrong: drives/b.csv: line 10: 'fast'")
    assert lines[-2].startswith("wrong: drives/c.csv: 4 steps of 0.1 s")
    assert lines[-1] == "--skip-bad leaves out each drive or file that is wrong"
    assert main(["check", *options, "--skip-bad"]) == 0
    assert "left out: drives/b.csv" in capsys.readouterr().out
    found = inspect_drives("drives", BODY)
    assert json.loads(json.dumps(found)) == found  # plain data
    with pytest.warns(RecordingWarning, match="left out: .*b.csv: line 10"):
        (drive,) = read_drives("drives", BODY, skip_bad=True)
    assert "a.csv" in drive.name
    Path("drives/a.csv").unlink()
    with pytest.raises(RecordingError, match="b.csv: line 10"):
        read_drives("drives", BODY, skip_bad=True)
    assert main(["check", *options]) == 1


def test_a_guessed_body_reads_the_recording(warthog, capsys):
    assert main(["body", "warthog.csv.gz", "--out", "guess.yaml"]) == 0
    assert "guess.yaml: check it, then run" in capsys.readouterr().out
    guess, body = read_body("guess.yaml"), read_body("robot.yaml")
    assert (guess.state, guess.actions) == (body.state, body.actions)
    assert (guess.pose, guess.rate, guess.name) == ("planar", 10, "warthog")
    assert main(["body", "warthog.csv.gz"]) == 0
    assert capsys.readouterr().out == Path("guess.yaml").read_text()
    assert main(["body", "warthog.csv.gz", "--out", "guess.yaml"]) == 2
    assert "guess.yaml: there is such a file" in capsys.readouterr().err


def test_a_guess_says_what_it_leaves_out(tmp_path):
    path = tmp_path / "my drive.csv"
    names = "stamp,x [m],y [m],yaw [deg],battery [%],no,label,2nd,motor [A],cmd_a [V]"
    rows = [
        f"{t},{t},{t / 100},{t},50,{1 + t % 1},on,1,{t % 3},{np.sin(t)}"
        for t in np.arange(60) / 4
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


TIME = 0.1 * np.arange(41)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (HELD, "no command changes; record drives"),
        (text().replace("throttle", "gas"), "no column seems to be a command"),
        (timed(TIME // 0.2, circle()), "the same time as the row before it"),
        (timed(-TIME, circle()), "s before the row before it"),
    ],
)
def test_a_file_that_gives_no_body_is_one_line(folder, content, words, capsys):
    Path("odd.csv").write_text(content)
    assert main(["body", "odd.csv"]) == 1
    said = capsys.readouterr().err
    assert words in said and said.count("\n") == 1


def test_a_percent_sign_of_a_body_needs_quotation_marks(folder):
    lines = Path("cart.yaml").read_text()
    assert read_body("cart.yaml").actions[0] == ("throttle", "%")
    Path("cart.yaml").write_text(lines.replace("'%'", "%"))
    with pytest.raises(ConfigError, match="write a unit of % as '%'"):
        read_body("cart.yaml")


def test_several_files_are_read_together(folder):
    """A command that changes in one file alone is no fault of the other."""
    Path("held.csv").write_text(HELD)
    paths = ["drives/a.csv", "held.csv"]
    drives = drives_from(paths, BODY, "novice")
    assert [drive.name for drive in drives] == [f"{path} drive 0" for path in paths]
    with pytest.raises(RecordingError, match="held.csv: 'throttle' never changes"):
        read_drives("held.csv", BODY)
    assert len(read_drives("held.csv", BODY, held=True)) == 1
    found = inspect_drives("held.csv", BODY)["common_faults"]
    assert found[0].startswith("held.csv: 'throttle' never changes; mend it")
    assert len(drives_from(paths, BODY, "expert", topics=["/odom"])) == 2
