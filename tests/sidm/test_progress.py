"""Progress on a terminal, in a notebook and in a log."""

import io
import sys

import pytest
from tqdm import tqdm

from sidm.progress import progress_bar


@pytest.fixture
def now(monkeypatch):
    """The time that the bars see, s."""
    time = [0.0]
    monkeypatch.setattr("tqdm.std.time", lambda: time[0])
    return time


def test_a_log_gets_whole_lines_with_the_time_left(now, capsys):
    with progress_bar(10, "trials", "trial") as bar:
        for number in range(10):
            now[0] += 12.0
            bar.set_postfix(loss=number, refresh=False)
            bar.update()
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 4 and not any("\r" in line for line in lines)
    assert "3/10 trial, 00:36 gone, 01:24 left, 12.00s/trial, loss=2" in lines[0]
    assert "10/10 trial, 02:00 gone, 00:00 left" in lines[-1]


@pytest.mark.parametrize(("seconds", "shown"), [(1.0, True), (100.0, False)])
def test_short_or_unseen_work_writes_nothing(now, capsys, seconds, shown):
    with progress_bar(3, "trials", "trial", shown=shown) as bar:
        for _ in range(3):
            now[0] += seconds
            bar.update()
    assert capsys.readouterr().err == ""


def test_a_terminal_gets_a_bar_unless_there_is_no_work(monkeypatch, capsys):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    with progress_bar(0, "trials", "trial") as bar:
        assert type(bar) is tqdm
    assert capsys.readouterr().err == ""


def test_a_notebook_gets_a_bar(monkeypatch):
    """The stream of a notebook is no terminal."""
    stream = type("OutStream", (io.StringIO,), {"__module__": "ipykernel.iostream"})()
    monkeypatch.setattr(sys, "stderr", stream)
    with progress_bar(2, "trials", "trial") as bar:
        bar.update(2)
    assert "trials: 100%" in stream.getvalue()
