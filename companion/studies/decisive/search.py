"""Step 0 of the decisive experiment: a random search of each method's settings, after DomainBed.

Draws follow the number of knobs: 10 for training alone and for fine-tuning, 20 for the
SIDM. Draw 0 is what the book used before, draw 1 the recipe R. Each draw has a seed,
and so a split, initial weights and batches, of its own.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from companion.methods import COMPARED
from companion.presets import MOST_SEEDS
from companion.studies.decisive.recipes import R, on_tuning_motion, to_the_cap
from companion.studies.tuning import rate_and_batch
from companion.study import Study
from companion.trials import Trial

MINUTES = 5.0
CAP = 3_000_000  # samples of a draw, and of a pretraining
DRAWS = {"sidm": 20, "novice_only": 10, "pretrain_finetune": 10}
FRESH_DRAWS = 4  # of each method on system 2
FIRST_SEED = MOST_SEEDS  # of draw 0; no figure's
#: of the best draws again, and of the comparison of units
AGAIN_SEEDS = (FIRST_SEED + 100, FIRST_SEED + 101)

#: Numbers of each method's two best draws on system 1 by `scores`, and of the one
#: chosen for recipe T on each system; empty until the search has been run.
BEST: dict[str, tuple[int, ...]] = {}
CHOSEN: dict[str, dict[str, int]] = {}

#: What tells settings apart, of `frame.frame_of`.
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

#: What each method had in the book before: changes of an untuned preset.
BEFORE: dict[str, dict[str, Any]] = {
    "novice_only": {"weight_decay": 0.1},
    "sidm": {"matching_iterations": 5},
    "pretrain_finetune": {"tuned": (("pretrain_finetune", "learning_rate", 1e-4),)},
}


class Draw(NamedTuple):
    """Settings of a method, by a number."""

    method: str
    number: int  # 0: as the book before, 1: the recipe R, else at random
    changes: dict[str, Any]  # of an untuned preset


def draw(method: str, number: int) -> Draw:
    """A method's settings of that number.

    At random are: rate, log-uniform from 1e-4 to 2e-3 (of fine-tuning from 1e-5 to
    1e-3); weight decay, log-uniform from 1e-6 to 0.3; batches of 2, 4 or 8; initial
    weights scaled or PyTorch's; for the SIDM also p_e from 0.5 to 0.95 and 5 to 100
    matching iterations, log-uniform. The pretraining has the rate, decay and batch of
    draw 0.
    """
    if number < 2:
        return Draw(method, number, (BEFORE[method], R)[number])
    rng = np.random.default_rng([zlib.crc32(method.encode()), number])
    tuning = method == "pretrain_finetune"
    values = rate_and_batch(
        int(rng.choice([2, 4, 8])),
        _log_uniform(rng, *((1e-5, 1e-3) if tuning else (1e-4, 2e-3))),
    ) | {"weight_decay": _log_uniform(rng, 1e-6, 0.3)}
    initialisation = {"initialisation": str(rng.choice(["scaled", "pytorch"]))}
    if tuning:
        own = tuple((method, name, value) for name, value in values.items())
        return Draw(method, number, initialisation | {"tuned": own})
    if method == "sidm":
        share = round(float(rng.uniform(0.5, 0.95)), 2)
        values |= {"p_expert_system1": share, "p_expert_system2": share}
        values |= {"matching_iterations": round(_log_uniform(rng, 5, 100))}
    return Draw(method, number, initialisation | values)


def _log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """A number between two, uniform in its logarithm, with three significant digits: the same on every machine."""
    return float(f"{np.exp(rng.uniform(np.log(low), np.log(high))):.3g}")


def first_draws() -> Iterator[Draw]:
    """All draws of all methods, those of a number side by side."""
    for number in range(max(DRAWS.values())):
        yield from (
            draw(method, number) for method, count in DRAWS.items() if number < count
        )


def trial_of(study: Study, system: str, chosen: Draw, seed: int) -> Trial:
    """A draw's training on tuning motion, to CAP."""
    base = on_tuning_motion(study)
    return base.changed(**chosen.changes | to_the_cap(CAP)).trial(
        system, chosen.method, MINUTES, seed
    )


def yardstick(study: Study, system: str, seed: int) -> Trial:
    """Least squares on a seed's split, whose test loss says how hard its few test trajectories are."""
    return (
        on_tuning_motion(study)
        .changed(**to_the_cap(CAP))
        .trial(system, "least_squares", MINUTES, seed)
    )


def with_yardsticks(study: Study, trials: list[Trial]) -> list[Trial]:
    """Trainings, and behind them the yardstick of each seed."""
    seeds = dict.fromkeys((trial.system, trial.seed) for trial in trials)
    return trials + [yardstick(study, *one) for one in seeds]


def first_search(study: Study, system: str = "system1") -> list[Trial]:
    """Step 0: all draws on system 1, each with its own seed."""
    return with_yardsticks(
        study,
        [
            trial_of(study, system, one, FIRST_SEED + one.number)
            for one in first_draws()
        ],
    )


def best_again(study: Study, system: str = "system1") -> list[Trial]:
    """The two best draws of each method with two more seeds."""
    draws = [
        draw(method, number) for method, numbers in BEST.items() for number in numbers
    ]
    return with_yardsticks(
        study,
        [trial_of(study, system, one, seed) for seed in AGAIN_SEEDS for one in draws],
    )


def units(study: Study, system: str = "system1") -> list[Trial]:
    """R with raw and with standardised units, of both of the paper's methods."""
    base, found = on_tuning_motion(study), []
    for seed in AGAIN_SEEDS:
        for kind in ("raw", "standardised"):
            changed = base.changed(**R | {"units": kind} | to_the_cap(CAP))
            found += [
                changed.trial(system, method, MINUTES, seed) for method in COMPARED
            ]
    return found


def second_search(study: Study, system: str = "system2") -> list[Trial]:
    """Step 0': the two best draws of each method, and four fresh ones, on system 2."""
    draws = [
        draw(method, number)
        for method, count in DRAWS.items()
        for number in (*BEST.get(method, ()), *range(count, count + FRESH_DRAWS))
    ]
    return with_yardsticks(
        study, [trial_of(study, system, one, FIRST_SEED + one.number) for one in draws]
    )


def scores(frame: pd.DataFrame) -> pd.DataFrame:
    """Stored draws from the best to the worst: a line a system, method and setting.

    Args:
        frame: trials of a search, with their yardsticks.

    Returns:
        `score`, the lowest smoothed test loss by that of least squares on the same
        split, the geometric mean over the `seeds`; and the mean validation loss, which
        nothing goes by.
    """
    yardsticks = (
        frame[frame.method == "least_squares"]
        .set_index(["system", "seed"])
        .best_test_loss
    )
    trained = frame[frame.method != "least_squares"]
    by = [
        yardsticks.get(key, np.nan)
        for key in zip(trained.system, trained.seed, strict=True)
    ]
    scored = trained.assign(score=np.log(trained.best_test_loss / by)).dropna(
        subset="score"
    )
    found = scored.groupby(["system", "method", *KNOBS], dropna=False).agg(
        score=("score", "mean"),
        validation_loss=("validation_loss", "mean"),
        seeds=("seed", "nunique"),
    )
    return (
        found.assign(score=np.exp(found.score))
        .reset_index()
        .sort_values(["system", "method", "score"])
    )
