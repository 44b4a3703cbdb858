"""Kill a collection and a study of small trials with SIGKILL at random moments.

`make crash` kills more often. Files and lines that were finished before a kill must not
change, a reader must never find half of one, and in the end everything must equal, bit
for bit, the files of an undisturbed run.
"""

from __future__ import annotations

import os
import random
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from companion import Results
from companion.engine.lines import append, line_of, read_lines, write_lines
from sidm.config import to_mapping
from sidm.storage import Damaged, read_arrays, read_record, write_record

pytestmark = pytest.mark.more

SETTINGS = {
    "expert_minutes": 0.2,
    "novice_minutes_system1": [0.25, 0.5],
    "pool_minutes_system1": 0.5,
    "validation_minutes": 0.2,
    "rollouts": 1,
    "pixels": 8,
    "hidden": 16,
    "max_samples": 12_000,
    "patience": 12_000,
}
READY = 1.0  # s; a process does nothing before
KILLS = int(os.environ.get("SIDM_KILLS", "1"))  # of each of the two commands


def command(verb: str, data: Path, results: Path) -> list[str]:
    """Command line of `companion collect` or `run` for the small study, two workers."""
    study = ["--preset", "smoke", "--system", "system1"]
    for name, value in SETTINGS.items():
        study += ["--set", f"{name}={value}"]
    places = ["--data", str(data), "--results", str(results), "--workers", "2"]
    return [sys.executable, "-m", "companion", verb, *study, *places]


def finish(words: list[str]) -> float:
    """Run a command to its end and return its seconds."""
    start = time.monotonic()
    subprocess.run(words, check=True, capture_output=True)
    return time.monotonic() - start


def kill_at(words: list[str], moment: float, whole_group: bool) -> bool:
    """Start a command and kill it after `moment` seconds, with or without its workers.

    Returns whether the command was still running.
    """
    quiet = dict(stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    process = subprocess.Popen(words, **quiet, start_new_session=True)
    try:
        process.wait(moment)
        return False
    except subprocess.TimeoutExpired:
        if whole_group:
            os.killpg(process.pid, signal.SIGKILL)
        else:
            process.kill()
        process.wait()
        return True


def finished(folder: Path, pattern: str) -> dict[tuple[Path, int], object]:
    """What changes when a finished file, or a finished line, is written again.

    Of a file of lines: every whole line, which has its date in it. Of any other file:
    its inode and time.
    """
    stamps: dict[tuple[Path, int], object] = {}
    for path in folder.rglob(pattern):
        if path.suffix == ".jsonl":
            lines = path.read_bytes().split(b"\n")[:-1]
            stamps |= {(path, number): line for number, line in enumerate(lines)}
        else:
            stamps[path, 0] = path.stat().st_ino, path.stat().st_mtime_ns
    return stamps


@contextmanager
def reader(
    folder: Path, pattern: str, read: Callable[[Path], object]
) -> Iterator[list[str]]:
    """Read all files repeatedly until the block ends; give a list of their faults."""
    wrong: list[str] = []
    done = threading.Event()

    def go_on() -> None:
        while not done.wait(0.02):
            try:
                for path in folder.rglob(pattern):
                    try:
                        read(path)
                    except Damaged as error:
                        wrong.append(f"{path}: {error}")
            except FileNotFoundError:
                pass  # the folder was emptied for another run

    thread = threading.Thread(target=go_on)
    thread.start()
    try:
        yield wrong
    finally:
        done.set()
        thread.join()


def torture(
    words: list[str],
    folder: Path,
    pattern: str,
    read: Callable[[Path], object],
    seconds: float,
    wanted: dict[str, object],
    chance: random.Random,
) -> None:
    """Kill a command KILLS times at work, and begin anew whenever it has ended.

    It writes files of a pattern into a folder, which `read` reads; undisturbed, it
    takes so many seconds and has the wanted `content`. AssertionError tells that a
    finished file or line was written again, half of one was read, or the final files
    differ.
    """
    met, known = 0, finished(folder, pattern)
    with reader(folder, pattern, read) as wrong:
        while True:
            if met < KILLS:
                moment = chance.uniform(READY, max(2 * READY, seconds))
                killed = kill_at(words, moment, whole_group=met % 2 == 0)
            else:
                finish(words)
                killed = False
            now = finished(folder, pattern)
            assert all(now.get(part) == stamp for part, stamp in known.items()), (
                "a finished file or line was written again"
            )
            known, met = now, met + killed
            if not killed:
                assert content(folder, pattern) == wanted, (
                    "other files than undisturbed"
                )
                if met == KILLS:
                    break
                shutil.rmtree(folder)
                known = {}
    assert not wrong, wrong[0]


def content(folder: Path, pattern: str) -> dict[str, object]:
    """Bytes of all shards; values of all rows without their provenance."""
    contents: dict[str, object] = {}
    for path in sorted(folder.rglob(pattern)):
        if path.suffix == ".npz":
            contents[str(path.relative_to(folder))] = path.read_bytes()
        else:
            for row in Results(path.parent).all():
                contents[row.trial.key] = to_mapping(row) | {"provenance": None}
    return contents


def test_nothing_is_lost(tmp_path):
    pytest.importorskip("pybullet")
    chance = random.Random(1)
    whole, hurt = (tmp_path / name for name in ("whole", "hurt"))
    for verb, place, pattern, read in (
        ("collect", "data", "shard-*.npz", read_arrays),
        ("run", "results", "trials.jsonl", lambda path: list(read_lines(path))),
    ):
        seconds = finish(command(verb, whole / "data", whole / "results"))
        wanted = content(whole / place, pattern)
        assert wanted
        words = command(verb, hurt / "data", hurt / "results")
        torture(words, hurt / place, pattern, read, seconds, wanted, chance)


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
