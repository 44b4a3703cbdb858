"""Step 0 of the decisive experiment: a random search of each method's settings.

The search follows DomainBed. Draws follow the number of knobs: 10 for training alone
and for fine-tuning, 20 for the SIDM. Draw 0 is what the book used before, draw 1 the
recipe R. Each draw has its own seed, and so its own split, initial weights and batches.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from typing import Any, NamedTuple

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

#: Numbers of each method's two best draws on system 1 by `scores`; a method is missing
#: until its search has been run.
BEST: dict[str, tuple[int, ...]] = {
    "novice_only": (0, 3),
    "sidm": (3, 10),
    "pretrain_finetune": (3, 9),
}
#: System -> method -> number of the draw chosen for recipe T, the better of the two
#: by the mean of three `scores`; a system is missing until its search has been run.
CHOSEN: dict[str, dict[str, int]] = {
    "system1": {"novice_only": 0, "sidm": 10, "pretrain_finetune": 3},
}

#: Columns of `frame.frame_of` in which two settings of a method can differ.
KNOBS = (
    "learning_rate",
    "weight_decay",
    "batch",
    "initialisation",
    "p_expert",
    "matching_iterations",
    "units",
    "decay",
)

#: Each method's settings in the book before: changes of an untuned preset.
BEFORE: dict[str, dict[str, Any]] = {
    "novice_only": {"weight_decay": 0.1},
    "sidm": {"matching_iterations": 5},
    "pretrain_finetune": {"tuned": (("pretrain_finetune", "learning_rate", 1e-4),)},
}


class Draw(NamedTuple):
    """Settings of a method in the random search."""

    method: str
    number: int  # 0: as in the book before, 1: recipe R, above: drawn at random
    changes: dict[str, Any]  # of an untuned preset


def draw(method: str, number: int) -> Draw:
    """A method's draw of that number.

    Drawn at random are: learning rate, log-uniform from 1e-4 to 2e-3 (of fine-tuning
    from 1e-5 to 1e-3); weight decay, log-uniform from 1e-6 to 0.3; batches of 2, 4 or
    8; initial weights scaled or PyTorch's; for the SIDM also p_e from 0.5 to 0.95 and 5
    to 100 matching iterations, log-uniform. The pretraining has the rate, decay and
    batch of draw 0.
    """
    if number < 2:
        return Draw(method, number, BEFORE[method] if number == 0 else R)
    rng = np.random.default_rng([zlib.crc32(method.encode()), number])
    finetuning = method == "pretrain_finetune"
    batch = int(rng.choice([2, 4, 8]))
    rate = _log_uniform(rng, *((1e-5, 1e-3) if finetuning else (1e-4, 2e-3)))
    decay = _log_uniform(rng, 1e-6, 0.3)
    changes = rate_and_batch(batch, rate) | {"weight_decay": decay}
    initialisation = {"initialisation": str(rng.choice(["scaled", "pytorch"]))}
    if finetuning:
        tuned = tuple((method, name, value) for name, value in changes.items())
        return Draw(method, number, initialisation | {"tuned": tuned})
    if method == "sidm":
        p_expert = round(float(rng.uniform(0.5, 0.95)), 2)
        changes |= {"p_expert_system1": p_expert, "p_expert_system2": p_expert}
        changes |= {"matching_iterations": round(_log_uniform(rng, 5, 100))}
    return Draw(method, number, initialisation | changes)


def _log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """A random number from `low` to `high`, uniform in its logarithm.

    It is rounded to three significant digits, so that it is the same on every machine.
    """
    return float(f"{np.exp(rng.uniform(np.log(low), np.log(high))):.3g}")


def first_draws() -> Iterator[Draw]:
    """All draws of all methods; those of the same number follow each other."""
    for number in range(max(DRAWS.values())):
        yield from (
            draw(method, number) for method, count in DRAWS.items() if number < count
        )


def trial_of(study: Study, system: str, settings: Draw, seed: int) -> Trial:
    """The training of a draw on tuning motion, to CAP samples."""
    changes = settings.changes | without_early_stopping(CAP)
    changed = on_tuning_motion(study).changed(**changes)
    return changed.trial(system, settings.method, MINUTES, seed)


def reference(study: Study, system: str, seed: int) -> Trial:
    """Least squares on the same split as the draw of a seed.

    Its test loss says how hard the few test trajectories of the split are.
    """
    changed = on_tuning_motion(study).changed(**without_early_stopping(CAP))
    return changed.trial(system, "least_squares", MINUTES, seed)


def with_references(study: Study, trials: list[Trial]) -> list[Trial]:
    """Trials, followed by the reference of each system and seed."""
    points = dict.fromkeys((trial.system, trial.seed) for trial in trials)
    return trials + [reference(study, system, seed) for system, seed in points]


def _one_seed_each(study: Study, system: str, draws: Iterator[Draw]) -> list[Trial]:
    """Trials of draws, each with the seed of its number, and their references."""
    trials = [trial_of(study, system, d, FIRST_SEED + d.number) for d in draws]
    return with_references(study, trials)


def first_search(study: Study) -> list[Trial]:
    """Step 0: all draws on system 1, each with its own seed."""
    return _one_seed_each(study, "system1", first_draws())


def best_repeated(study: Study) -> list[Trial]:
    """The two best draws of each method with two more seeds."""
    draws = [
        draw(method, number) for method, numbers in BEST.items() for number in numbers
    ]
    trials = [
        trial_of(study, "system1", d, seed) for seed in REPEAT_SEEDS for d in draws
    ]
    return with_references(study, trials)


def compare_units(study: Study) -> list[Trial]:
    """Recipe R with raw and standardised units, for both of the paper's methods."""
    base, trials = on_tuning_motion(study), []
    for seed in REPEAT_SEEDS:
        for units in ("raw", "standardised"):
            changes = R | {"units": units} | without_early_stopping(CAP)
            changed = base.changed(**changes)
            trials += [
                changed.trial("system1", method, MINUTES, seed) for method in COMPARED
            ]
    return trials


def second_search(study: Study) -> list[Trial]:
    """Step 0': the two best draws of each method, and four fresh ones, on system 2."""
    draws = (
        draw(method, number)
        for method, count in DRAWS.items()
        for number in (*BEST.get(method, ()), *range(count, count + FRESH_DRAWS))
    )
    return _one_seed_each(study, "system2", draws)


def scores(frame: pd.DataFrame) -> pd.DataFrame:
    """Stored draws from the best to the worst: a row per system, method and setting.

    `score` is the lowest smoothed test loss divided by that of least squares on the
    same split, the search's reference, as a geometric mean over the `seeds`. By the
    mean `validation_loss` nothing is chosen.
    """
    solved = frame.method == "least_squares"
    reference_losses = frame[solved].set_index(["system", "seed"]).best_test_loss
    trained = frame[~solved]
    references = [
        reference_losses.get(key, np.nan)
        for key in zip(trained.system, trained.seed, strict=True)
    ]
    scored = trained.assign(score=np.log(trained.best_test_loss / references))
    means = (
        scored.dropna(subset="score")
        .groupby(["system", "method", *KNOBS], dropna=False)
        .agg(
            score=("score", "mean"),
            validation_loss=("validation_loss", "mean"),
            seeds=("seed", "nunique"),
        )
    )
    table = means.assign(score=np.exp(means.score)).reset_index()
    return table.sort_values(["system", "method", "score"])


def draws_of(frame: pd.DataFrame) -> pd.DataFrame:
    """Stored draws of `first_search`, one training each: a row per draw.

    There are `method`, `number` of the draw, `score` as in `scores`, and
    `validation_loss`.
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
    """The draws of `draws_of` with the headings of a page."""
    draws = draws_of(frame)
    labels = draws.method.map(lambda name: METHODS[name].label)
    names = {
        "number": "draw",
        "validation_loss": "validation loss",
        "score": "test loss by that of least squares",
    }
    return draws.assign(method=labels)[["method", *names]].rename(columns=names)
