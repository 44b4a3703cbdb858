"""`ownrobot demo`: the packaged data and the results."""

from pathlib import Path

import ownrobot
from ownrobot.__main__ import main
from ownrobot.demo import bundled_drives

ROOT = Path(__file__).parents[2]


def test_what_is_bundled_is_what_was_recorded():
    for name in ("warthog.csv.gz", "skid_steer.yaml", "LICENSE-DRIVE.txt"):
        assert (ROOT / "ownrobot" / "demo" / name).read_bytes() == (
            ROOT / "recordings" / name
        ).read_bytes()
    assert len(bundled_drives()) == 287


def test_the_demo_makes_a_model_its_errors_and_a_replay(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["demo"]) == 0
    output = capsys.readouterr().out
    assert "least_squares" in output and "yaw_rate" in output and "position" in output
    assert ownrobot.load("ownrobot-demo/model").method == "least_squares"
    assert Path("ownrobot-demo/replay.html").stat().st_size > 100_000
