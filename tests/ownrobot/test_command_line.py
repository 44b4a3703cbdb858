"""The command line: names, help, pipes, and what is wrong is one line."""

import subprocess
import sys
from pathlib import Path

import pytest

import ownrobot
from ownrobot.__main__ import main
from ownrobot.demo import bundled_drives

ROOT = Path(__file__).parents[2]
RECORDINGS = ROOT / "recordings"
WARTHOG, SKID = RECORDINGS / "warthog.csv.gz", RECORDINGS / "skid_steer.yaml"
MODEL = RECORDINGS / "models" / "warthog"
FIT = f"fit --novice {WARTHOG} --body {SKID} --out model"


@pytest.fixture(autouse=True)
def small_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "drives").mkdir()
    for name in ("file", "drive.csv", "drives/0.csv"):
        (tmp_path / name).write_text("")


@pytest.mark.parametrize(
    ("words", "line"),
    [
        ("", "name a command, demo, check"),
        ("fti", "unknown command 'fti'; did you mean 'fit'?"),
        (f"{FIT} --set hidden", "--set takes NAME=VALUE"),
        (f"{FIT} --device qpu", "device 'qpu' cannot be used"),
        (f"fit --novice {WARTHOG} --body {SKID} --out file", "file is a file"),
        (f"fit --novice {WARTHOG} --body none.yaml --out m", "none.yaml: there is no"),
        (f"evaluate nowhere {WARTHOG}", "nowhere: no model is there"),
        (f"evaluate {MODEL} {WARTHOG} --figure a.foo", "a.foo: no kind of figure"),
        (f"evaluate {MODEL} {WARTHOG} --csv file/a.csv", "file/a.csv"),
        (f"predict {MODEL} {WARTHOG} --topics /a", "topics are of ROS bags"),
        (f"evaluate {MODEL} drive.csv --csv drive.csv", "drive.csv is read, too"),
        (f"replay drive.csv --body {SKID} --html drive.csv", "drive.csv is read, too"),
        (f"predict {MODEL} drives --out drives/0.csv", "drives/0.csv is read, too"),
        (f"compare {WARTHOG} --body {SKID} --out file", "'file' is no folder"),
        (f"compare drives --body {SKID} --out drives", "drives is read, too"),
        (f"predict {MODEL} {WARTHOG} --out {MODEL}/model.json", "is read, too"),
        (f"evaluate {MODEL} {WARTHOG} --csv a --drives-csv a", "a is written twice"),
        (f"compare {WARTHOG} --body {SKID} --out {MODEL}", "has a model; name another"),
        (f"compare {WARTHOG} --body {SKID} --seed -1", "seed must be 0 or more"),
        (f"predict {MODEL} {WARTHOG} --horizon 3m", "a time is as 3s"),
        (f"predict {MODEL} {WARTHOG} --horizon 0.001s", "below one step of 0.1 s"),
    ],
)
def test_what_cannot_be_done_is_one_line(words, line, capsys):
    try:
        status = main(words.split())
    except SystemExit as end:
        status = end.code
    said = capsys.readouterr().err.splitlines()[-1]
    assert status in (1, 2) and line in said and said.startswith("ownrobot: ")
    assert not Path("model").exists() and not Path("m").exists()
    assert Path("drive.csv").read_text() == Path("drives/0.csv").read_text() == ""


def test_who_stops_reading_is_told_nothing():
    """The output is far longer than a pipe holds."""
    command = f"{sys.executable} -m ownrobot predict {MODEL} {WARTHOG} | head -1"
    result = subprocess.run(
        ["bash", "-c", f"set -o pipefail; {command}"], capture_output=True, text=True
    )
    assert result.returncode == 0
    assert result.stdout.startswith("drive,time [s],")
    assert all(line.startswith("note: ") for line in result.stderr.splitlines())


def test_a_replay_shows_the_prediction_too():
    words = f"replay {WARTHOG} --model {MODEL} --shape warthog --drive 3 --html a.html"
    assert main(words.split()) == 0
    plain = f"replay {WARTHOG} --body {SKID} --shape warthog --drive 3 --html b.html"
    assert main(plain.split()) == 0
    pages = [Path(name).read_text() for name in ("a.html", "b.html")]
    assert '"model"' in pages[0] and '"model"' not in pages[1]


def test_a_replay_of_another_body_than_the_models_is_refused(capsys):
    Path("two.yaml").write_text(SKID.read_text().replace("yaw_rate: rad/s, ", ""))
    words = f"replay {WARTHOG} --model {MODEL} --body two.yaml --html a.html"
    assert main(words.split()) == 2
    said = capsys.readouterr().err.splitlines()[-1]
    assert "which differs from body 'skid-steered' in its state" in said


def test_a_link_stays_a_link():
    Path("target.csv").write_text("old")
    Path("link.csv").symlink_to("target.csv")
    assert main(["predict", str(MODEL), str(WARTHOG), "--out", "link.csv"]) == 0
    assert Path("link.csv").is_symlink()
    assert Path("target.csv").read_text().startswith("drive,")


def test_the_demo_makes_a_model_its_errors_and_a_replay(capsys):
    for name in ("warthog.csv.gz", "skid_steer.yaml", "LICENSE-DRIVE.txt"):
        bundled = ROOT / "ownrobot" / "demo" / name
        assert bundled.read_bytes() == (RECORDINGS / name).read_bytes()
    drives = bundled_drives()
    assert len({drive.name for drive in drives}) == len(drives) == 287
    assert main(["demo"]) == 0
    output = capsys.readouterr().out
    assert "least_squares" in output and "yaw_rate" in output and "position" in output
    assert ownrobot.load("ownrobot-demo/model").method == "least_squares"
    assert Path("ownrobot-demo/replay.html").stat().st_size > 100_000
