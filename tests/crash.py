"""Kill a collection and a study of small trials with SIGKILL at random moments: `make crash`.

What was finished before a kill must stay untouched, a reader must never meet half a file, and in the end everything
must equal, bit for bit, what an undisturbed run makes.
"""

from __future__ import annotations

import argparse
import os
import random
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from sidm.storage import Damaged, read_arrays, read_record

SETTINGS = {
    "expert_minutes": 0.75, "novice_minutes_system1": [0.25, 0.5], "pool_minutes_system1": 0.5,
    "validation_minutes": 0.25, "rollouts": 2, "pixels": 8, "hidden": 16, "max_samples": 30_000, "patience": 30_000,
}  # fmt: skip
READY = 1.0  # s that a process needs at least before it does anything


def command(verb: str, data: Path, results: Path) -> list[str]:
    """`python -m sidm collect` or `run` of the small study, with two workers."""
    changes = [word for name, value in SETTINGS.items() for word in ("--set", f"{name}={value}")]
    places = ["--data", str(data), "--results", str(results), "--workers", "2"]
    return [sys.executable, "-m", "sidm", verb, "--preset", "smoke", "--system", "system1", *places, *changes]


def finish(words: list[str]) -> float:
    """Run a command to its end; how many seconds it took."""
    start = time.monotonic()
    subprocess.run(words, check=True, capture_output=True)
    return time.monotonic() - start


def kill_at(words: list[str], moment: float, whole_group: bool) -> bool:
    """Start a command and kill it after so many seconds, its workers too or not; whether it was still running."""
    process = subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True)
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
    return {path: (path.stat().st_ino, path.stat().st_mtime_ns) for path in folder.rglob(pattern)}


@contextmanager
def reader(folder: Path, pattern: str, read: Callable[[Path], object]) -> Iterator[list[str]]:
    """Reads all files again and again until the block ends; gives the list of what was wrong with them."""
    wrong: list[str] = []
    done = threading.Event()

    def go_on() -> None:
        while not done.wait(0.02):
            for path in folder.rglob(pattern):
                try:
                    read(path)
                except Damaged as error:
                    wrong.append(f"{path}: {error}")

    thread = threading.Thread(target=go_on)
    thread.start()
    try:
        yield wrong
    finally:
        done.set()
        thread.join()


def torture(
    words: list[str], folder: Path, pattern: str, read: Callable[[Path], object], kills: int, seconds: float,
    chance: random.Random,
) -> int:  # fmt: skip
    """Kill a command `kills` times and let it end; how many kills met it at work.

    Raises:
        AssertionError: a finished file was written again, or half a file was read.
    """
    met, known = 0, stamps(folder, pattern)
    with reader(folder, pattern, read) as wrong:
        for number in range(kills):
            met += kill_at(words, chance.uniform(READY, max(2 * READY, seconds)), whole_group=number % 2 == 0)
            now = stamps(folder, pattern)
            assert all(now.get(path) == stamp for path, stamp in known.items()), "a finished file was written again"
            known = now
        finish(words)
        now = stamps(folder, pattern)
        assert all(now.get(path) == stamp for path, stamp in known.items()), "a finished file was written again"
    assert not wrong, wrong[0]
    return met


def content(folder: Path, pattern: str) -> dict[str, object]:
    """Shards to the byte; of rows all but where they come from."""
    found: dict[str, object] = {}
    for path in sorted(folder.rglob(pattern)):
        if path.suffix == ".npz":
            found[str(path.relative_to(folder))] = path.read_bytes()
        else:
            found[path.name] = {name: value for name, value in read_record(path).items() if name != "provenance"}
    return found


def crash(kills: int, seed: int, root: Path) -> list[str]:
    """The whole test in a folder; a line on each half of it."""
    chance, lines = random.Random(seed), []
    whole, hurt = (root / name for name in ("whole", "hurt"))
    stages = (("collect", "data", "shard-*.npz", read_arrays), ("run", "results", "trials/*.json", read_record))
    for verb, place, pattern, read in stages:
        seconds = finish(command(verb, whole / "data", whole / "results"))
        words = command(verb, hurt / "data", hurt / "results")
        met = torture(words, hurt / place, pattern, read, kills, seconds, chance)
        wanted, found = (content(one / place, pattern) for one in (whole, hurt))
        assert wanted and found == wanted, f"{verb}: other results than undisturbed"
        lines.append(f"{verb}: {len(found)} files as undisturbed after {kills} kills, {met} of them at work")
    return lines


def main() -> None:
    """The whole test with as many kills as asked for."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split(":")[0])
    parser.add_argument("--kills", type=int, default=20, help="of the collection and of the study, each")
    parser.add_argument("--seed", type=int, default=0, help="of the moments")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        for line in crash(options.kills, options.seed, Path(folder)):
            print(line)


if __name__ == "__main__":
    main()
