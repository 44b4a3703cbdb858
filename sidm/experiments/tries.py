"""How the methods were tuned: the same number of tries each, at one middle size, with a seed that no figure has.

The try of the lowest test loss on system 1 is what the preset `laptop` has; those on system 2 are a check.
"""

from __future__ import annotations

from typing import Any

from sidm.experiments.presets import MOST_SEEDS, Preset

TUNING_SEED = MOST_SEEDS  # no figure's: theirs are below


def _rate(batch: int, learning_rate: float) -> dict[str, Any]:
    """A batch and a rate, tests as often in samples as the preset's, the phases of Algorithm 2 with the same batch."""
    return dict(
        batch=batch, discriminator_batch=batch, matching_batch=batch,
        learning_rate=learning_rate, test_interval=200 // batch,
    )  # fmt: skip


_ALL: dict[str, dict[str, Any]] = {
    "batch 8, rate 0.001 (the base)": _rate(8, 1e-3),
    "batch 8, rate 0.0005": _rate(8, 5e-4),
    "batch 4, rate 0.001": _rate(4, 1e-3),
    "batch 4, rate 0.0005": _rate(4, 5e-4),
    "patience 450,000": {"patience": 450_000},
}

#: Method -> its tries, in words and as changes of the untuned preset, for all trainings of the method.
TRIES: dict[str, dict[str, dict[str, Any]]] = {
    "novice_only": _ALL | {"batch 2, rate 0.0003": _rate(2, 3e-4), "weight decay 0.1": {"weight_decay": 0.1}},
    "sidm": _ALL | {
        "the other system's p_e": {"p_expert_system1": 0.5, "p_expert_system2": 0.75},
        "5 matching iterations": {"matching_iterations": 5},
    },
    "pretrain_finetune": _ALL | {
        "rate 0.0003 of the fine-tuning alone": {"tuned": (("pretrain_finetune", "learning_rate", 3e-4),)},
        "rate 0.0001 of the fine-tuning alone": {"tuned": (("pretrain_finetune", "learning_rate", 1e-4),)},
    },
}  # fmt: skip


def tried(preset: Preset, method: str, words: str) -> Preset:
    """The preset of a try of a method: untuned but for the try's changes."""
    return preset.replace(**({"tuned": ()} | TRIES[method][words]))
