"""A random search of the boosted trees' settings, as step 0 has it for the networks.

It runs on the motion on which the networks' settings are chosen: system 1, 5 minutes of
the novice; of the expert an hour, as in the benchmark. Draw 0 is what the trees had
before. All draws have the same splits, and a draw's score is its test loss divided by
that of least squares.

`companion run --figure tree-search` measures it and writes `results/tree_search.json`.
"""

from __future__ import annotations

import zlib
from pathlib import Path
from typing import Any

import numpy as np
import torch

from companion.engine.library import Library
from companion.engine.records import read_or_empty
from companion.numerics import versions
from companion.studies.decisive.recipes import on_tuning_motion
from companion.studies.decisive.search import FIRST_SEED, MINUTES
from companion.study import Study
from companion.trials import Trial
from ownrobot.methods import boosting, least_squares
from ownrobot.methods.boosting import Forest, Growth
from ownrobot.methods.fine_tuning import pretraining_datasets
from sidm.body import ROVER
from sidm.learning.dataset import Datasets
from sidm.learning.units import Standardisation
from sidm.pool import as_completed, local_pool
from sidm.storage import write_record

NAME = "tree_search.json"
SYSTEM, EXPERT_MINUTES = "system1", 120.0
EXPERT_DRIVES = 562  # of the expert's that are learnt from: an hour
#: Draws of each method; the correction has the settings of two forests.
DRAWS = {"trees": 10, "trees_corrected": 20}
SEEDS = (FIRST_SEED, FIRST_SEED + 1, FIRST_SEED + 2)  # of the splits
ROUNDS = 300  # trees of a component at most; the test split may stop before
LEAVES = (7, 15, 31, 63)
RATES, SAMPLES = (0.02, 0.3), (5, 100)  # ends of the ranges, log-uniform
#: Settings of draw 0: of the novice's trees and of the expert's.
BEFORE = Growth(ROUNDS, 0.05, 15, 20), Growth(ROUNDS, 0.1, 31, 20)


def draw(method: str, number: int) -> list[Growth]:
    """A method's draw of that number: settings of its forests.

    They are the novice's and, of trees that are corrected, the expert's.
    """
    growths = list(BEFORE)
    if number:
        rng = np.random.default_rng([zlib.crc32(method.encode()), number])
        growths = [_growth(rng), _growth(rng)]
    return growths if method == "trees_corrected" else growths[:1]


def _growth(rng: np.random.Generator) -> Growth:
    rate, samples = (
        float(np.exp(rng.uniform(*np.log(ends)))) for ends in (RATES, SAMPLES)
    )
    leaves = int(rng.choice(LEAVES))
    return Growth(ROUNDS, float(f"{rate:.2g}"), leaves, round(samples))


def _trial(study: Study, seed: int) -> Trial:
    """Names the split and the motion."""
    changed = on_tuning_motion(study).changed(expert_minutes=EXPERT_MINUTES)
    return changed.trial(SYSTEM, "least_squares", MINUTES, seed)


def losses(method: str, number: int, splits: dict[int, Datasets]) -> list[float]:
    """The test loss of a draw's trees on each split, by its seed.

    The expert's trees are grown once, on the split of the draw's number.
    """
    base = Forest.constant(torch.zeros(len(ROVER.targets)))
    novice, *expert = draw(method, number)
    if expert:
        motion = pretraining_datasets(next(iter(splits.values())), number)
        base = boosting.grow(motion, ROVER, base, expert[0], number).forest
    return [
        float(boosting.grow(split, ROVER, base, novice, seed).test_errors.sum())
        for seed, split in splits.items()
    ]


def references(splits: dict[int, Datasets]) -> list[float]:
    """The cross-validated loss of least squares on each split."""
    found = []
    for split in splits.values():
        assert split.expert is not None
        units = Standardisation.fit(split.expert)
        found.append(least_squares.fit(split, units).best_test_loss)
    return found


def make(study: Study, workers: int, data: Path, results: Path) -> dict[str, Any]:
    """Search the settings.

    Draws that are done are kept among the data, so that the same command goes on.
    """
    library, kept = Library(data), data / "checkpoints" / NAME
    splits = {seed: _load(library, _trial(study, seed)) for seed in SEEDS}
    made = {"numerics": versions("fitting")}
    known = read_or_empty(kept)
    found = known["losses"] if known.get("numerics") == made["numerics"] else {}
    draws = [(name, n) for name, count in DRAWS.items() for n in range(count)]
    missing = [key for key in draws if "{} {}".format(*key) not in found]
    with local_pool(workers) as pool:
        futures = {pool.submit(losses, *key, splits): key for key in missing}
        for done in as_completed(futures):
            of_draw = [round(loss, 6) for loss in done.result()]
            found["{} {}".format(*futures[done])] = of_draw
            write_record(kept, {"losses": found, **made})
    rows: dict[str, list[Any]] = {
        name: [
            [[list(growth) for growth in draw(name, n)], found[f"{name} {n}"]]
            for n in range(count)
        ]
        for name, count in DRAWS.items()
    }
    least = [round(loss, 6) for loss in references(splits)]
    kept.unlink(missing_ok=True)
    return {**rows, "least_squares": least}


def _load(library: Library, trial: Trial) -> Datasets:
    """The split of a trial, with EXPERT_DRIVES of the expert."""
    datasets = library.datasets(trial)
    assert datasets.expert is not None
    return datasets._replace(expert=datasets.expert.first(EXPERT_DRIVES))
