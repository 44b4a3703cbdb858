"""The methods: configurations of the one training loop. What tells them apart stands here, and what they were tuned to.

The preset's numbers are those of its `training`, with the changes of its `tuned` for a method.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any

from sidm.experiments.presets import Preset
from sidm.learning.settings import Training


def change(training: Training, **changes: Any) -> Training:
    """`training` with some values changed, checked like a new one."""
    own = {field.name: getattr(training, field.name) for field in dataclasses.fields(training)}  # type: ignore
    return Training(**(own | changes))


def _training(preset: Preset, method: str, **changes: Any) -> Training:
    """The preset's training with what a method was tuned to, and `changes`."""
    return change(preset.training, **preset.tuned_values(method), **changes)


def _sidm(preset: Preset, system: str) -> Training:
    """The paper's method: expert data with probability p_e, and the adversary."""
    return _training(preset, "sidm", p_expert=preset.p_expert(system), regularise=True)


def _novice_only(preset: Preset, system: str) -> Training:
    """The paper's comparison: novice data alone, no regularisation phase (section 4)."""
    return _training(preset, "novice_only", p_expert=0.0, regularise=False)


def _no_regularisation(preset: Preset, system: str) -> Training:
    """Shared SIDM without the adversary."""
    return _training(preset, "sidm", p_expert=preset.p_expert(system), regularise=False)


def _finetuning(preset: Preset, system: str) -> Training:
    """The novice's data alone, from weights that learnt from the expert's, which the paper argues against."""
    return _training(preset, "pretrain_finetune", p_expert=0.0, regularise=False)


def _pretraining(preset: Preset) -> Training:
    """The expert's data alone."""
    return _training(preset, "pretraining", p_expert=0.0, regularise=False)


#: Name -> the training of a method on a system.
METHODS: dict[str, Callable[[Preset, str], Training]] = {
    "sidm": _sidm,
    "novice_only": _novice_only,
    "no_regularisation": _no_regularisation,
    "pretrain_finetune": _finetuning,
}

#: Name -> the training on the expert alone that a method's weights come from; the others begin afresh.
PRETRAINED: dict[str, Callable[[Preset], Training]] = {"pretrain_finetune": _pretraining}

#: The two methods that the paper compares.
COMPARED = ("sidm", "novice_only")

#: What Figure 3 draws here: what a reviewer asks for first is in it from the start.
FIGURE3 = (*COMPARED, "pretrain_finetune")

#: Another choice than ours or the paper's, most of them the released code's -> changes of the preset, methods touched.
CHOICES: dict[str, tuple[dict[str, Any], tuple[str, ...]]] = {
    "PyTorch's initial weights": ({"initialisation": "pytorch"}, FIGURE3),
    "loss averaged over components": ({"reduction": "mean"}, FIGURE3),
    "weight decay of 0.00001 in the gradient (L2)": ({"decay": "l2", "weight_decay": 1e-5}, FIGURE3),
    "patience of 450,000 samples": ({"patience": 450_000}, FIGURE3),
    "one system a batch": ({"system_draw": "iteration"}, ("sidm",)),
    "matching by the prediction's optimiser": ({"matching_optimiser": "shared"}, ("sidm",)),
}
