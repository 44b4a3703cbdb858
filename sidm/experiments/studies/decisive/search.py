"""Step 0 of the decisive experiment: a random search of each method's settings, after DomainBed.

Draws follow the number of knobs: 10 for training alone and for fine-tuning, 20 for the SIDM. Draw 0 is what the book
used before, draw 1 the recipe R. Each draw has a seed, and so a split, initial weights and batches, of its own.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from sidm.experiments.presets import MOST_SEEDS
from sidm.experiments.studies.decisive.recipes import R, on_tuning_motion, to_the_cap
from sidm.experiments.studies.tuning import rate_and_batch
from sidm.experiments.study import Study
from sidm.experiments.trials import Trial

MINUTES = 5.0
CAP = 3_000_000  # samples of a draw, and of a pretraining
DRAWS = {"sidm": 20, "novice_only": 10, "pretrain_finetune": 10}
FIRST_SEED = MOST_SEEDS  # of draw 0; no figure's
AGAIN_SEEDS = (FIRST_SEED + 100, FIRST_SEED + 101)  # of the best draws again, and of the comparison of units

#: What each method had in the book before: changes of an untuned preset.
BEFORE: dict[str, dict[str, Any]] = {
    "novice_only": {"weight_decay": 0.1},
    "sidm": {"matching_iterations": 5},
    "pretrain_finetune": {"tuned": (("pretrain_finetune", "learning_rate", 1e-4),)},
}


class Draw(NamedTuple):
    """One setting of a method."""

    method: str
    number: int  # 0: as the book before, 1: the recipe R, else at random
    changes: dict[str, Any]  # of an untuned preset


def draw(method: str, number: int) -> Draw:
    """A method's settings of that number.

    At random are: rate, log-uniform from 1e-4 to 2e-3 (of fine-tuning from 1e-5 to 1e-3); weight decay, log-uniform
    from 1e-6 to 0.3; batches of 2, 4 or 8; initial weights scaled or PyTorch's; for the SIDM also p_e from 0.5 to 0.95
    and 5 to 100 matching iterations, log-uniform. The pretraining has the rate, decay and batch of draw 0.
    """
    if number < 2:
        return Draw(method, number, (BEFORE[method], R)[number])
    rng = np.random.default_rng([zlib.crc32(method.encode()), number])
    tuning = method == "pretrain_finetune"
    values = rate_and_batch(
        int(rng.choice([2, 4, 8])), _log_uniform(rng, *((1e-5, 1e-3) if tuning else (1e-4, 2e-3)))
    ) | {"weight_decay": _log_uniform(rng, 1e-6, 0.3)}  # fmt: skip
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
        yield from (draw(method, number) for method, count in DRAWS.items() if number < count)


def trial_of(study: Study, system: str, chosen: Draw, seed: int) -> Trial:
    """A draw's training on tuning motion, to CAP."""
    base = on_tuning_motion(study)
    return base.changed(**chosen.changes | to_the_cap(CAP)).trial(system, chosen.method, MINUTES, seed)


def yardstick(study: Study, system: str, seed: int) -> Trial:
    """Least squares on a seed's split, whose test loss says how hard its few test trajectories are."""
    return on_tuning_motion(study).changed(**to_the_cap(CAP)).trial(system, "least_squares", MINUTES, seed)
