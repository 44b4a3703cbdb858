"""What training the encoders in bfloat16 does to the final loss: python benchmarks/precision.py, half an hour.

Pairs of trials of the preset `laptop` that differ in their precision alone; the validation losses of the weights that
early stopping keeps. It needs the preset's data: sidm collect --preset laptop --system system1
"""

from __future__ import annotations

import argparse
import dataclasses
import multiprocessing

import numpy as np
import torch

from sidm.experiments import Study
from sidm.experiments.engine.execute import Library
from sidm.experiments.statistics.intervals import leave_one_out
from sidm.learning import train, validation_loss

METHOD, MINUTES, SAMPLES = "sidm", 5.0, 400_000
FIRST_SEED = 200  # no figure's


def final_loss(task: tuple[int, str]) -> tuple[int, str, float]:
    """The seed, the precision, and the validation loss that they lead to."""
    torch.set_num_threads(1)
    seed, precision = task
    trial = Study("laptop").trial("system1", METHOD, MINUTES, seed)
    training = dataclasses.replace(trial.training, precision=precision, max_samples=SAMPLES)
    sets = Library().datasets(trial)
    model = train(sets, trial.network, training, seed).model
    return seed, precision, float(validation_loss(model, sets.validation).sum())


def main() -> None:
    """A line a pair, then the mean ratio."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split(":")[0])
    parser.add_argument("--pairs", type=int, default=12)
    options = parser.parse_args()
    tasks = [(FIRST_SEED + pair, p) for pair in range(options.pairs) for p in ("float32", "bfloat16")]
    losses: dict[int, dict[str, float]] = {}
    with multiprocessing.get_context("spawn").Pool(2) as pool:
        for seed, precision, loss in pool.imap(final_loss, tasks, chunksize=1):
            pair = losses.setdefault(seed, {})
            pair[precision] = loss
            if len(pair) == 2:
                low, exact = pair["bfloat16"], pair["float32"]
                print(f"seed {seed}: float32 {exact:.4f}, bfloat16 {low:.4f}, ratio {low / exact:.4f}", flush=True)
    ratios = np.log([pair["bfloat16"] / pair["float32"] for pair in losses.values()])
    mean, low, high = np.exp(leave_one_out(np.mean, ratios))
    print(f"{METHOD}, {MINUTES:g} min, {len(ratios)} pairs: geometric mean ratio {mean:.4f} [{low:.4f}, {high:.4f}]")


if __name__ == "__main__":
    main()
