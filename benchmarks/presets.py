"""Measure what each preset asks of one core.

`python benchmarks/presets.py` takes six minutes; the preset `paper` takes nearly all of
this time and 8 GB of memory. The script times collection and training for a while. From
these rates it computes the hours of Figure 3 if every training went on to its cap of
samples: an upper bound, since most trainings stop early.
"""

from __future__ import annotations

import dataclasses
import multiprocessing
import time
from collections.abc import Callable

import numpy as np
import torch
from simulation import collecting
from work import random_data

from companion.engine.provenance import peak_memory
from companion.pages.markdown import markdown_table
from companion.presets import PRESETS, Preset, load_preset
from companion.registry import grid
from sidm.drives import STEPS
from sidm.learning.trainer import Trainer
from sidm.learning.training import (
    discriminator_iteration,
    matching_iteration,
    prediction_phase,
)
from sidm.systems import SYSTEMS

ROUNDS = 3
MAP_BYTES = 2  # a pixel, as float16
HOUR = 36_000  # control steps of 0.1 s
HEAD = (
    "preset",
    "motion (h)",
    "its maps (GB)",
    "to collect (h)",
    "training (samples a s)",
    "memory (MiB)",
    "Figure 3: trainings",
    "at most (h)",
)


def seconds(work: Callable[[], object], least: float = 2.0) -> float:
    """Mean wall-clock time of one call, over as many calls as fill `least` seconds."""
    calls, start = 0, time.perf_counter()
    while calls == 0 or time.perf_counter() - start < least:
        work()
        calls += 1
    return (time.perf_counter() - start) / calls


def training(name: str) -> tuple[list[float], float]:
    """Measure SIDM's training with Algorithm 2 as often as the preset runs it.

    It needs a process of its own, uses one thread, and trains on random numbers, which
    take as long as real ones.

    Returns:
        Samples a second, one value a round, and the peak memory of this process, MiB.
    """
    torch.set_num_threads(1)
    preset = load_preset(name)
    usual = dataclasses.replace(preset.training, **preset.tuned_values("sidm"))
    endless = dict(test_interval=10**9, max_samples=10**12, patience=10**12)
    single = dataclasses.replace(usual, prediction_iterations=1, **endless)
    sets = random_data(preset.network.pixels)
    trainer = Trainer(sets, preset.network, single, seed=0)
    parts: dict[Callable[[Trainer], object], int] = {
        prediction_phase: usual.prediction_iterations,
        discriminator_iteration: usual.discriminator_iterations,
        matching_iteration: usual.matching_iterations,
    }
    rates = []
    for number in range(1 + ROUNDS):  # the first warms up
        phase = sum(
            count * seconds(lambda part=part: part(trainer))
            for part, count in parts.items()
        )
        if number:
            rates.append(usual.prediction_iterations * usual.batch * STEPS / phase)
    return rates, peak_memory()


def motion(preset: Preset) -> int:
    """Number of control steps of all data sets of both systems."""
    return sum(
        dataset.count * STEPS
        for system in SYSTEMS
        for dataset in preset.datasets(system).values()
    )


def main() -> None:
    """Print a table in Markdown, a row for each preset."""
    pace = np.array([collecting(1) for _ in range(ROUNDS)])
    lines = []
    for name, preset in PRESETS.items():
        with multiprocessing.get_context("spawn").Pool(1) as pool:
            rates, memory = pool.apply(training, [name])
        steps = motion(preset)
        seeds = max(
            preset.seeds_at(minutes)
            for system in SYSTEMS
            for minutes in preset.novice_minutes(system)
        )
        # the trainings on the expert's data alone are not trials of the grid
        trainings = len(grid(preset, "3")) + seeds * len(SYSTEMS)
        hours = trainings * preset.training.max_samples / np.median(rates) / 3600
        lines.append(
            (
                name,
                steps / HOUR,
                steps * MAP_BYTES * preset.network.pixels**2 / 1e9,
                steps / np.median(pace) / 3600,
                f"{np.median(rates):,.0f} [{min(rates):,.0f}, {max(rates):,.0f}]",
                round(memory),
                trainings,
                hours if hours < 100 else f"{float(f'{hours:.3g}'):,.0f}",
            )
        )
    print(markdown_table(HEAD, lines))
    print(
        f"One core collects {np.median(pace):.0f} control steps a second "
        f"[{pace.min():.0f}, {pace.max():.0f}]."
    )


if __name__ == "__main__":
    main()
