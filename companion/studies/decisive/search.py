"""Step 0 of the decisive experiment: a random search of each method's settings.

The search follows DomainBed. Draws follow the number of knobs: 10 for training alone
and for fine-tuning, 20 for the SIDM. Draw 0 is what the book used before, draw 1 the
recipe R. Each draw has its own seed, and so its own split, initial weights and batches.
"""

from __future__ import annotations

import zlib
from typing import Any

import numpy as np
import pandas as pd

from companion.methods import COMPARED, METHODS
from companion.presets import MOST_SEEDS
from companion.studies.decisive.recipes import (
    R,
    on_tuning_motion,
    without_early_stopping,
)
from companion.studies.tuning import rate_and_batch
from companion.study import Study
from companion.trials import Trial

MINUTES = 5.0
CAP = 3_000_000  # samples of a draw, and of a pretraining
DRAWS = {"sidm": 20, "novice_only": 10, "pretrain_finetune": 10}
FRESH_DRAWS = 4  # additional draws of each method on system 2
FIRST_SEED = MOST_SEEDS  # seed of draw 0; no figure has it
#: seeds of the repeated best draws, and of the comparison of units
REPEAT_SEEDS = (FIRST_SEED + 100, FIRST_SEED + 101)

#: Numbers of each method's two best draws on system 1 by their `scores`; a method is
#: missing until its search has been run.
BEST: dict[str, tuple[int, ...]] = {
    "novice_only": (0, 3),
    "sidm": (3, 10),
    "pretrain_finetune": (3, 9),
}
#: System -> method -> number of the draw chosen for recipe T. On system 1 it is the
#: better of the two best by the geometric mean of three `scores`, on system 2 the best
#: of one each; a method is missing until its search has been run.
CHOSEN: dict[str, dict[str, int]] = {
    "system1": {"novice_only": 0, "sidm": 10, "pretrain_finetune": 3},
    "system2": {"novice_only": 11, "sidm": 10},
}

#: Each method's settings in the book before: changes of an untuned preset.
BEFORE: dict[str, dict[str, Any]] = {
    "novice_only": {"weight_decay": 0.1},
    "sidm": {"matching_iterations": 5},
    "pretrain_finetune": {"tuned": (("pretrain_finetune", "learning_rate", 1e-4),)},
}


def draw(method: str, number: int) -> dict[str, Any]:
    """A method's draw of that number: changes of an untuned preset.

    Drawn at random are: learning rate, log-uniform from 1e-4 to 2e-3 (of fine-tuning
    from 1e-5 to 1e-3); weight decay, log-uniform from 1e-6 to 0.3; batches of 2, 4 or
    8; initial weights scaled or PyTorch's; for the SIDM also p_e from 0.5 to 0.95 and 5
    to 100 matching iterations, log-uniform. The pretraining has the rate, decay and
    batch of draw 0.
    """
    if number < 2:
        return BEFORE[method] if number == 0 else R
    rng = np.random.default_rng([zlib.crc32(method.encode()), number])
    finetuning = method == "pretrain_finetune"
    batch = int(rng.choice([2, 4, 8]))
    rate = _log_uniform(rng, *((1e-5, 1e-3) if finetuning else (1e-4, 2e-3)))
    changes = rate_and_batch(batch, rate) | {
        "weight_decay": _log_uniform(rng, 1e-6, 0.3)
    }
    initialisation = {"initialisation": str(rng.choice(["scaled", "pytorch"]))}
    if finetuning:
        tuned = tuple((method, name, value) for name, value in changes.items())
        return initialisation | {"tuned": tuned}
    if method == "sidm":
        p_expert = round(float(rng.uniform(0.5, 0.95)), 2)
        changes |= {"p_expert_system1": p_expert, "p_expert_system2": p_expert}
        changes |= {"matching_iterations": round(_log_uniform(rng, 5, 100))}
    return initialisation | changes


def _log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """A random number, uniform in its logarithm; three digits are alike everywhere."""
    return float(f"{np.exp(rng.uniform(np.log(low), np.log(high))):.3g}")


def _trial(
    study: Study, system: str, method: str, seed: int, changes: dict[str, Any]
) -> Trial:
    """A training on tuning motion, to CAP samples."""
    changed = on_tuning_motion(study).changed(**changes | without_early_stopping(CAP))
    return changed.trial(system, method, MINUTES, seed)


def _search(
    study: Study, system: str, draws: list[tuple[str, int, int]]
) -> list[Trial]:
    """The trainings of draws: method, number and seed of each; and their references.

    Least squares on the same split say how hard its few test trajectories are.
    """
    trials = [_trial(study, system, m, seed, draw(m, n)) for m, n, seed in draws]
    seeds = dict.fromkeys(trial.seed for trial in trials)
    return trials + [_trial(study, system, "least_squares", s, {}) for s in seeds]


def first_search(study: Study) -> list[Trial]:
    """Step 0: all draws on system 1, each with its own seed."""
    draws = [
        (method, number, FIRST_SEED + number)
        for number in range(max(DRAWS.values()))
        for method, count in DRAWS.items()
        if number < count
    ]
    return _search(study, "system1", draws)


def best_repeated(study: Study) -> list[Trial]:
    """The two best draws of each method with two more seeds."""
    draws = [
        (method, number, seed)
        for seed in REPEAT_SEEDS
        for method, numbers in BEST.items()
        for number in numbers
    ]
    return _search(study, "system1", draws)


def second_search(study: Study) -> list[Trial]:
    """Step 0': the two best draws of each method, and four fresh ones, on system 2."""
    draws = [
        (method, number, FIRST_SEED + number)
        for method, count in DRAWS.items()
        for number in (*BEST.get(method, ()), *range(count, count + FRESH_DRAWS))
    ]
    return _search(study, "system2", draws)


def compare_units(study: Study) -> list[Trial]:
    """Recipe R with raw and standardised units, for both of the paper's methods."""
    return [
        _trial(study, "system1", method, seed, R | {"units": units})
        for seed in REPEAT_SEEDS
        for units in ("raw", "standardised")
        for method in COMPARED
    ]


def scores(frame: pd.DataFrame) -> pd.DataFrame:
    """Stored draws of `first_search`, one training each: a row per draw.

    There are `method`, `number` of the draw, `validation_loss`, by which nothing is
    chosen, and `score`: the lowest smoothed test loss divided by that of least squares
    on the same split.
    """
    solved = frame.method == "least_squares"
    references = frame[solved].set_index("seed").best_test_loss
    trained = frame[~solved]
    table = trained[["method", "validation_loss"]].assign(
        number=trained.seed - FIRST_SEED,
        score=trained.best_test_loss / trained.seed.map(references),
    )
    return table.sort_values(["method", "number"]).reset_index(drop=True)


def page_table(frame: pd.DataFrame) -> pd.DataFrame:
    """The draws of `scores` with the headings of a page."""
    draws = scores(frame)
    labels = draws.method.map(lambda name: METHODS[name].label)
    names = {
        "number": "draw",
        "validation_loss": "validation loss",
        "score": "test loss by that of least squares",
    }
    return draws.assign(method=labels)[["method", *names]].rename(columns=names)
