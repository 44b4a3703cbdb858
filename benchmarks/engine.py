"""What the engine itself costs, how two processes share two cores, and what would limit many workers.

The last part is on paper: durations drawn from those of the stored trials of the preset `laptop`, handed out one by one
to whoever is free, the longest first; collection by shards at the rate of one core measured here.
"""

from __future__ import annotations

import contextlib
import heapq
import io
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from sidm.experiments import Results, Study, Trial, collect_datasets, load_preset, run
from sidm.pool import local_pool
from sidm.simulation import collect
from sidm.trajectory import SHARD_SIZE, STEPS, Collection

TRIALS, STEPS_IN_ALL = 320, 2_000_000  # the paper's Figure 3 and its data
WORKERS = (1, 16, 256)
START = 4.0  # s that a worker takes to import PyTorch and PyBullet
ROUNDS = 3


def trials(data: Path) -> list[Trial]:
    """Eight trials of some seconds each with the networks of the preset `laptop`, their data made where they lack."""
    networks = load_preset("laptop").network
    sizes = dict(pixels=networks.pixels, hidden=networks.hidden, layers=networks.layers, prediction_iterations=100)
    preset = load_preset("smoke", **sizes, seeds=4, novice_minutes_system1=[2.0], max_samples=15_000, test_interval=25)
    collect_datasets(preset, ["system1"], data, progress=False)
    return Study(preset, data, data / "none").figure3("system1")


def wall_time(work: Sequence[Trial], workers: int, data: Path) -> tuple[float, float]:
    """Seconds that a run takes, and those of its trials in all; workers that have started already."""
    with tempfile.TemporaryDirectory() as results, local_pool(workers) as pool:
        list(pool.map(time.sleep, [0.5] * workers))
        run(work[:workers], pool, data=data, results=Path(results) / "warm", progress=False)
        start = time.perf_counter()
        store = run(work, pool, data=data, results=results, progress=False)
        seconds = time.perf_counter() - start
        assert not store.missing(work)
        return seconds, sum(row.provenance.seconds for row in store.rows(work))


def collection_rate() -> float:
    """Control steps a second of one process."""
    with tempfile.TemporaryDirectory() as root, local_pool(1) as pool:
        collection = Collection(system="system1", role="novice")
        collect(root, collection, SHARD_SIZE, executor=pool, progress=False)
        start = time.perf_counter()
        collect(root, collection, 5 * SHARD_SIZE, executor=pool, progress=False)
        return 4 * SHARD_SIZE * STEPS / (time.perf_counter() - start)


def makespan(durations: Sequence[float], workers: int) -> float:
    """Seconds until the last is done, the longest handed out first, every worker starting up once."""
    free = [START] * min(workers, len(durations))
    for duration in sorted(durations, reverse=True):
        heapq.heappush(free, heapq.heappop(free) + duration)
    return max(free)


def on_paper(rate: float) -> None:
    """Print what so many workers would take, and the share of it that is work."""
    stored = [row.provenance.seconds for row in Results().all()]
    draw = np.random.default_rng(0)
    training = draw.choice(stored, TRIALS)
    print(f"stored trials: {len(stored)}, median {np.median(stored):.0f} s, longest {max(stored):.0f} s")
    for unit in (1, 4, 16):
        shard = unit * STEPS / rate
        shards = [shard] * (STEPS_IN_ALL // (unit * STEPS))
        for workers in WORKERS:
            took = makespan(shards, workers)
            print(f"collect {STEPS_IN_ALL} steps, {unit} trajectories a task, {workers} workers: {took / 60:.1f} min, "
                  f"{sum(shards) / took / workers:.0%} work")  # fmt: skip
    for workers in WORKERS:
        took = makespan(training, workers)
        print(f"train {TRIALS} trials, {workers} workers: {took / 60:.1f} min, {training.sum() / took / workers:.0%} "
              f"work, the longest trial alone {training.max() / 60:.1f} min")  # fmt: skip


def main() -> None:
    """Measure, then draw."""
    with tempfile.TemporaryDirectory() as folder, contextlib.redirect_stderr(io.StringIO()):
        work = trials(Path(folder))
        both = [(wall_time(work, 1, Path(folder)), wall_time(work, 2, Path(folder))) for _ in range(ROUNDS)]
    ratios = [one[0] / two[0] for one, two in both]
    print(f"two processes over one: {np.median(ratios):.2f} times [{min(ratios):.2f}, {max(ratios):.2f}]")
    costs = [(one[0] - one[1]) / len(work) for one, _ in both]
    print(f"the engine's own time: {np.median(costs):.3f} s a trial [{min(costs):.3f}, {max(costs):.3f}]")
    rate = collection_rate()
    print(f"collection: {rate:.0f} control steps a second and core")
    on_paper(rate)


if __name__ == "__main__":
    main()
