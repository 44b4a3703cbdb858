"""Progress on a terminal, in a notebook and in a log."""

import io
import sys

import pytest

from sidm.progress import progress_bar


@pytest.mark.parametrize(
    ("seconds", "shown", "lines"), [(12.0, True, 4), (1.0, True, 0), (12.0, False, 0)]
)
def test_a_log_gets_a_few_whole_lines(monkeypatch, capsys, seconds, shown, lines):
    """Short or unseen work writes nothing."""
    now = [0.0]
    monkeypatch.setattr("tqdm.std.time", lambda: now[0])
    with progress_bar(10, "trials", "trial", shown=shown) as bar:
        for number in range(10):
            now[0] += seconds
            bar.set_postfix(loss=number, refresh=False)
            bar.update()
    found = capsys.readouterr().err.splitlines()
    assert len(found) == lines and not any("\r" in line for line in found)
    if lines:
        assert "3/10 trial, 00:36 gone, 01:24 left, 12.00s/trial, loss=2" in found[0]
        assert "10/10 trial, 02:00 gone, 00:00 left" in found[-1]


@pytest.mark.parametrize("terminal", [True, False])
def test_a_terminal_and_a_notebook_get_a_bar(monkeypatch, terminal):
    """The stream of a notebook is no terminal."""
    module = "somewhere" if terminal else "ipykernel.iostream"
    stream = type("OutStream", (io.StringIO,), {"__module__": module})()
    stream.isatty = lambda: terminal
    monkeypatch.setattr(sys, "stderr", stream)
    with progress_bar(2, "trials", "trial") as bar:
        bar.update(2)
    assert "trials: 100%" in stream.getvalue()
