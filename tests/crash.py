"""Kill a collection and a study of small trials with SIGKILL at random moments: `make
crash`.

What was finished before a kill must stay untouched, a reader must never meet half a
file, and in the end everything must equal, bit for bit, what an undisturbed run makes.
"""

from __future__ import annotations

import argparse
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from sidm.storage import Damaged, read_arrays, read_record

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
READY = 1.0  # s that a process needs at least before it does anything


def command(verb: str, data: Path, results: Path) -> list[str]:
    """`companion collect` or `run` of the small study, with two workers."""
    changes = [
        word
        for name, value in SETTINGS.items()
        for word in ("--set", f"{name}={value}")
    ]
    places = ["--data", str(data), "--results", str(results), "--workers", "2"]
    return [
        sys.executable,
        "-m",
        "companion",
        verb,
        "--preset",
        "smoke",
        "--system",
        "system1",
        *places,
        *changes,
    ]


def finish(words: list[str]) -> float:
    """Run a command to its end; how many seconds it took."""
    start = time.monotonic()
    subprocess.run(words, check=True, capture_output=True)
    return time.monotonic() - start


def kill_at(words: list[str], moment: float, whole_group: bool) -> bool:
    """Start a command and kill it after so many seconds, its workers too or not;
    whether it was still running."""
    process = subprocess.Popen(
        words,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
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


def stamps(folder: Path, pattern: str) -> dict[Path, tuple[int, int]]:
    """Every finished file, with what changes when it is written again."""
    return {
        path: (path.stat().st_ino, path.stat().st_mtime_ns)
        for path in folder.rglob(pattern)
    }


@contextmanager
def reader(
    folder: Path, pattern: str, read: Callable[[Path], object]
) -> Iterator[list[str]]:
    """Reads all files again and again until the block ends; gives the list of what was
    wrong with them."""
    wrong: list[str] = []
    done = threading.Event()

    def go_on() -> None:
        while not done.wait(0.02):
            for path in folder.rglob(pattern):
                try:
                    read(path)
                except FileNotFoundError:
                    pass  # the folder was emptied for another run
                except Damaged as error:
                    wrong.append(f"{path}: {error}")

    thread = threading.Thread(target=go_on)
    thread.start()
    try:
        yield wrong
    finally:
        done.set()
        thread.join()


@dataclass
class Stage:
    """A command whose files are watched."""

    words: list[str]
    folder: Path  # that it writes to
    pattern: str  # of its finished files
    read: Callable[[Path], object]
    seconds: float  # that it takes undisturbed
    wanted: dict[str, object]  # what it makes undisturbed


def torture(stage: Stage, kills: int, chance: random.Random) -> int:
    """Kill a command so many times at work, begin anew whenever it has come to its end;
    how often that was.

    Raises:
        AssertionError: a finished file was written again, half a file was read, or
            other files came out.
    """
    met, ends, known = 0, 0, stamps(stage.folder, stage.pattern)
    with reader(stage.folder, stage.pattern, stage.read) as wrong:
        while True:
            if met < kills:
                moment = chance.uniform(READY, max(2 * READY, stage.seconds))
                killed = kill_at(stage.words, moment, whole_group=met % 2 == 0)
            else:
                finish(stage.words)
                killed = False
            now = stamps(stage.folder, stage.pattern)
            assert all(now.get(path) == stamp for path, stamp in known.items()), (
                "a finished file was written again"
            )
            known, met = now, met + killed
            if not killed:
                ends += 1
                assert content(stage.folder, stage.pattern) == stage.wanted, (
                    "other files than undisturbed"
                )
                if met == kills:
                    break
                shutil.rmtree(stage.folder)
                known = {}
    assert not wrong, wrong[0]
    return ends


def content(folder: Path, pattern: str) -> dict[str, object]:
    """Shards to the byte; of rows all but where they come from."""
    found: dict[str, object] = {}
    for path in sorted(folder.rglob(pattern)):
        if path.suffix == ".npz":
            found[str(path.relative_to(folder))] = path.read_bytes()
        else:
            found[path.name] = {
                name: value
                for name, value in read_record(path).items()
                if name != "provenance"
            }
    return found


def crash(kills: int, seed: int, root: Path) -> list[str]:
    """The whole test in a folder; a line on each half of it."""
    chance, lines = random.Random(seed), []
    whole, hurt = (root / name for name in ("whole", "hurt"))
    kinds = (
        ("collect", "data", "shard-*.npz", read_arrays),
        ("run", "results", "trials/*.json", read_record),
    )
    for verb, place, pattern, read in kinds:
        seconds = finish(command(verb, whole / "data", whole / "results"))
        wanted = content(whole / place, pattern)
        assert wanted
        words = command(verb, hurt / "data", hurt / "results")
        ends = torture(
            Stage(words, hurt / place, pattern, read, seconds, wanted), kills, chance
        )
        lines.append(
            f"{verb}: {len(wanted)} files as undisturbed, {ends} times, through {kills} kills at work"
        )
    return lines


def main() -> None:
    """The whole test with as many kills as asked for."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split(":")[0])
    parser.add_argument(
        "--kills", type=int, default=20, help="of the collection and of the study, each"
    )
    parser.add_argument("--seed", type=int, default=0, help="of the moments")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        for line in crash(options.kills, options.seed, Path(folder)):
            print(line)


if __name__ == "__main__":
    main()
