"""Killing at random moments loses nothing; `make crash` kills more often."""

import pytest
from crash import crash, finished, reader

from companion.engine.lines import append, line_of, write_lines
from sidm.storage import read_record, write_record

pytestmark = pytest.mark.more


def test_nothing_is_lost(tmp_path):
    pytest.importorskip("pybullet")
    lines = crash(1, seed=1, root=tmp_path)
    assert [line.split(":")[0] for line in lines] == ["collect", "run"]


def test_the_reader_would_see_half_a_file(tmp_path):
    path = tmp_path / "a.json"
    write_record(path, {"x": list(range(100))})
    with reader(tmp_path, "*.json", read_record) as wrong:
        pass
    assert wrong == []
    path.write_text(path.read_text()[:50])
    with reader(tmp_path, "*.json", read_record) as wrong:
        while not wrong:
            pass
    assert "a.json" in wrong[0]


def test_a_line_written_again_would_be_seen(tmp_path):
    path = tmp_path / "trials.jsonl"
    write_lines(path, [{"seconds": 1}])
    first = finished(tmp_path, "*.jsonl")
    append(path, line_of({"seconds": 2}).encode() + b'{"half', path.stat().st_size)
    assert finished(tmp_path, "*.jsonl").items() > first.items()
    write_lines(path, [{"seconds": 3}, {"seconds": 2}])
    assert not finished(tmp_path, "*.jsonl").items() >= first.items()
