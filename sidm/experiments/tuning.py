"""How the methods were tuned: the same number of tries each, at one middle size, with a seed that no figure has.

The try of the lowest test loss on system 1 is what the preset `laptop` has; those on system 2 are a check.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, NamedTuple

from sidm.experiments.methods import METHODS
from sidm.experiments.presets import MOST_SEEDS, Preset
from sidm.experiments.store import Results
from sidm.experiments.tables import differences
from sidm.experiments.trials import Trial

TUNING_SEED = MOST_SEEDS  # no figure's: theirs are below


def _rate(batch: int, learning_rate: float) -> dict[str, Any]:
    """A batch and a rate, tests as often in samples as the preset's, the phases of Algorithm 2 with the same batch."""
    return dict(
        batch=batch, discriminator_batch=batch, matching_batch=batch,
        learning_rate=learning_rate, test_interval=200 // batch,
    )  # fmt: skip


_RATES = (_rate(8, 1e-3), _rate(8, 5e-4), _rate(4, 1e-3), _rate(4, 5e-4))
_PATIENT = {"patience": 450_000}

#: Method -> its tries: changes of the untuned preset, for all trainings of the method.
TRIES: dict[str, tuple[dict[str, Any], ...]] = {
    "novice_only": (*_RATES, _rate(2, 3e-4), {"weight_decay": 0.1}, _PATIENT),
    "sidm": (*_RATES, {"p_expert_system1": 0.5, "p_expert_system2": 0.75}, {"matching_iterations": 5}, _PATIENT),
    "pretrain_finetune": (
        *_RATES,
        {"tuned": (("pretrain_finetune", "learning_rate", 3e-4),)},  # of the fine-tuning alone
        {"tuned": (("pretrain_finetune", "learning_rate", 1e-4),)},
        _PATIENT,
    ),
}


def tried(preset: Preset, method: str, number: int) -> Preset:
    """The preset of try `number` of a method: untuned but for the try's changes."""
    return preset.replace(**({"tuned": ()} | TRIES[method][number]))


class Try(NamedTuple):
    """A line of the table of tries."""

    system: str
    method: str
    changes: str  # of the fine-tuning where the method has a pretraining too
    test_loss: float  # smoothed, of the weights that were kept: what the choice goes by
    validation_loss: float
    samples: int  # of prediction, the pretraining's among them
    chosen: bool  # the lowest test loss of its method and system


def tries_table(trials: Iterable[Trial], store: Results, preset: Preset) -> list[Try]:
    """The stored tries among the `trials` of `Study.tuning`."""
    base = preset.replace(tuned=())
    found = [row for trial in trials if (row := store.get(trial)) is not None]
    best: dict[tuple[str, str], float] = {}
    for row in found:
        key = row.trial.system, row.trial.method
        best[key] = min(best.get(key, float("inf")), row.outcome.best_test_loss)
    return [
        Try(
            row.trial.system,
            row.trial.method,
            differences(row.trial.training, METHODS[row.trial.method](base, row.trial.system)) or "as the preset",
            row.outcome.best_test_loss,
            row.outcome.validation_loss,
            row.outcome.samples + row.outcome.pretraining_samples,
            row.outcome.best_test_loss == best[row.trial.system, row.trial.method],
        )
        for row in found
    ]
