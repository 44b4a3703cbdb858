"""How long until our training is as good as the reference's best: python benchmarks/time_to_loss.py, half an hour.

The reference trains as the released code does: batches of two trajectories of one system, learning rate 1e-4, L2
penalty, shared moments, mean over components; stopped early by the preset's rule. Its losses come from our trainer,
which `tests/learning/test_reference.py` holds to a plain implementation, and its time from the stand-in of the released
loop: so many iterations at the rate of its prediction iterations on two threads, the phases of Algorithm 2 not counted.
Ours has the settings of the preset `laptop`, on one thread while another training runs beside it.

It needs the preset's data: sidm collect --preset laptop --system system1
"""

from __future__ import annotations

import dataclasses
import multiprocessing
import time
from typing import NamedTuple

import torch
from released import ReleasedLoop

from sidm.experiments import Study, Trial, load_preset
from sidm.experiments.engine.execute import Library
from sidm.learning.evaluation import mean_loss
from sidm.learning.learner import Learner
from sidm.learning.regularisation import regularise_phase
from sidm.learning.training import predict_phase

REFERENCE = dict(
    batch=2, discriminator_batch=2, matching_batch=2, learning_rate=1e-4, decay="l2", system_draw="iteration",
    matching_optimiser="shared", reduction="mean", max_samples=6_000_000,
)  # fmt: skip
POINTS = (("sidm", 20.0), ("sidm", 5.0), ("novice_only", 20.0))  # method and novice minutes
SEED = 100  # no figure's


class Point(NamedTuple):
    """A phase at whose end the best weights so far were better than before."""

    iterations: int  # of prediction
    seconds: float  # of training, tests included
    loss: float  # on the validation set


def descent(trial: Trial, wanted: float) -> list[Point]:
    """Train until the validation loss of the best weights is at most `wanted` or training ends."""
    torch.set_num_threads(1)
    sets = Library().datasets(trial)
    learner, points, seconds, best = Learner(sets, trial.network, trial.training, trial.seed), [], 0.0, -1
    while not learner.finished and not (points and points[-1].loss <= wanted):
        start = time.perf_counter()
        predict_phase(learner)
        if trial.training.regularise and not learner.finished:
            regularise_phase(learner)
        seconds += time.perf_counter() - start
        if learner.stopper.best_iteration != best:
            best, now = learner.stopper.best_iteration, learner.weights()
            learner.model.load_state_dict(learner.best)
            points.append(Point(best, seconds, mean_loss(learner.model, sets.validation)))
            learner.model.load_state_dict(now)
    return points


def iterations_a_second(rounds: int = 5) -> float:
    """The stand-in's prediction iterations at the preset's sizes, maps cut at the networks' own resolution."""
    torch.set_num_threads(2)
    network = load_preset("laptop").network
    loop, rates = ReleasedLoop(network.pixels, network), []
    for _ in range(rounds):
        start = time.perf_counter()
        loop.iterate(200)
        rates.append(200 / (time.perf_counter() - start))
    return sorted(rates)[rounds // 2]


def main() -> None:
    """A line a point: the reference's loss and time, ours, and their ratio."""
    rate = iterations_a_second()
    print(f"the stand-in takes {rate:.1f} prediction iterations a second on two threads")
    study = Study(load_preset("laptop"))
    ours = [study.trial("system1", method, minutes, SEED) for method, minutes in POINTS]
    plain = [one.replace(training=dataclasses.replace(one.training, **REFERENCE)) for one in ours]
    with multiprocessing.get_context("spawn").Pool(2) as pool:
        references = pool.starmap(descent, [(one, 0.0) for one in plain], chunksize=1)
        wanted = [reference[-1].loss for reference in references]
        found = pool.starmap(descent, list(zip(ours, wanted, strict=True)), chunksize=1)
    for trial, reference, mine in zip(ours, references, found, strict=True):
        theirs = reference[-1].iterations / rate
        reached = "" if mine[-1].loss <= reference[-1].loss else " (NOT REACHED)"
        print(
            f"{trial}: reference {reference[-1].loss:.4f} after {reference[-1].iterations} iterations, {theirs:.0f} s; "
            f"ours {mine[-1].loss:.4f} after {mine[-1].iterations}, {mine[-1].seconds:.0f} s{reached}; "
            f"ratio {mine[-1].seconds / theirs:.3f}",
            flush=True,
        )


if __name__ == "__main__":
    main()
