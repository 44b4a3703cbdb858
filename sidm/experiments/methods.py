"""The methods: configurations of the one training loop. What tells them apart stands here, and what they were tuned to.

The preset's numbers are those of its `training`, with the changes of its `tuned` for a method. The method `all_data`,
training without SIDM on all novice data, is `novice_only` at the largest size.
"""

from __future__ import annotations

import dataclasses
from typing import Any, Literal, NamedTuple

from sidm.experiments.presets import Preset
from sidm.learning.settings import Training


def change(training: Training, **changes: Any) -> Training:
    """`training` with some values changed, checked like a new one."""
    return dataclasses.replace(training, **changes)  # type: ignore[type-var]


#: Of training that begins with what an expert's data gave, and whose lowest loss may come within a few batches: five
#: times as many tests as otherwise, smoothed over as long.
FINER_TESTS = {"test_interval": 5, "smoothing": 0.87}


class Method(NamedTuple):
    """A configuration of the one training loop."""

    label: str  # for figures and tables
    tuned_as: str  # whose tuned settings it has; '' where nothing of the training loop is used
    expert: bool = False  # whether it learns from the expert's data too, with the preset's p_e
    regularise: bool = False  # whether the latents are made alike
    pretrained: bool = False  # whether it starts from weights that learnt from the expert alone
    carried: Literal["all", "sidm"] = "all"  # what of those weights it starts from; 'sidm': the shared part alone
    residual: bool = False  # whether it learns to correct them instead
    fit: Literal["gradients", "least_squares"] = "gradients"  # what it learns by
    own: Literal["all", "biases", "flag", "none"] = "all"  # what each system has of encoder and decoder for itself
    changes: tuple[tuple[str, Any], ...] = ()  # of its training
    all_changes: tuple[tuple[str, Any], ...] = ()  # of its training, and of its pretraining

    def training(self, preset: Preset, system: str) -> Training:
        """Its training on a system's novice: the preset's, with what it was tuned to and what it changes."""
        values = preset.tuned_values(self.tuned_as) | dict(self.all_changes) | dict(self.changes)
        p_expert = preset.p_expert(system) if self.expert else 0.0
        return change(preset.training, **(dict(p_expert=p_expert, regularise=self.regularise) | values))

    def pretraining(self, preset: Preset) -> Training | None:
        """Its training on the expert alone; None for a method that begins afresh."""
        if not self.pretrained:
            return None
        values = preset.tuned_values("pretraining") | dict(self.all_changes)
        return change(preset.training, **values, p_expert=0.0, regularise=False)


#: The methods by name.
METHODS: dict[str, Method] = {
    # The paper's method, and its comparison on novice data alone (section 4).
    "sidm": Method("with SIDM", "sidm", expert=True, regularise=True),
    "novice_only": Method("without SIDM", "novice_only"),
    # Pretraining on the expert; section 4 says that the SIDM cannot be pretrained so.
    "pretrain_finetune": Method("pretraining + fine-tuning", "pretrain_finetune", pretrained=True),
    "finetune_parts": Method(
        "pretraining + fine-tuning of encoder and decoder", "pretrain_finetune", pretrained=True,
        changes=(("frozen", "sidm"),),
    ),
    "expert_only": Method(
        "expert's model as it is", "pretrain_finetune", pretrained=True, changes=(("max_samples", 0),)
    ),
    "residual": Method("expert's model, corrected by a network", "novice_only", pretrained=True, residual=True),
    # No network for the novice at all.
    "least_squares": Method("least squares", "", fit="least_squares"),
    # The SIDM without its adversary, and with others.
    "no_regularisation": Method("SIDM, no adversary", "sidm", expert=True),
    "strong_matching": Method(
        "SIDM, stronger matching", "sidm", expert=True, regularise=True,
        changes=(("discriminator_iterations", 5), ("matching_iterations", 100)),
    ),
    "mmd": Method("SIDM, MMD", "sidm", expert=True, regularise=True, changes=(("matching", "mmd"),)),
    "coral": Method("SIDM, CORAL", "sidm", expert=True, regularise=True, changes=(("matching", "coral"),)),
    "gradient_reversal": Method(
        "SIDM, gradient reversal", "sidm", expert=True, regularise=True, changes=(("matching", "reversal"),)
    ),
    # One network for both systems.
    "pooled": Method("joint training (one network)", "sidm", expert=True, own="none"),
    "pooled_flag": Method("joint training with a system flag", "sidm", expert=True, own="flag"),
    # Beyond the paper: pretraining, and then...
    "copies": Method("pretraining + SIDM", "copies", expert=True, regularise=True, pretrained=True),
    "copies_no_regularisation": Method(
        "pretraining + SIDM, no adversary", "copies", expert=True, pretrained=True
    ),
    "adapters": Method(
        "pretraining + joint training, own biases", "pretrain_finetune", expert=True, pretrained=True, own="biases"
    ),
    "tethered": Method(
        "pretraining + fine-tuning, tethered (L2-SP)", "pretrain_finetune", pretrained=True,
        changes=(("tether", 100.0),),
    ),
    "averaged": Method(
        "pretraining + fine-tuning, averaged", "pretrain_finetune", pretrained=True, all_changes=(("averaging", 0.99),)
    ),
    "mirrored": Method(
        "pretraining + fine-tuning, mirrored", "pretrain_finetune", pretrained=True, all_changes=(("mirror", True),)
    ),
    "mirrored_averaged": Method(
        "pretraining + fine-tuning, mirrored and averaged", "pretrain_finetune", pretrained=True,
        all_changes=(("mirror", True), ("averaging", 0.99)),
    ),
    "corrected": Method(
        "pretraining + least squares", "", pretrained=True, residual=True, fit="least_squares"
    ),
    "corrected_mirrored": Method(
        "pretraining + least squares, mirrored", "", pretrained=True, residual=True, fit="least_squares",
        all_changes=(("mirror", True),),
    ),
    "corrected_averaged": Method(
        "pretraining + least squares, mirrored and averaged", "", pretrained=True, residual=True,
        fit="least_squares", all_changes=(("mirror", True), ("averaging", 0.99)),
    ),
    # What mirror images do for methods without pretraining.
    "sidm_mirrored": Method("with SIDM, mirrored", "sidm", expert=True, regularise=True, changes=(("mirror", True),)),
    "novice_only_mirrored": Method("without SIDM, mirrored", "novice_only", changes=(("mirror", True),)),
    "least_squares_mirrored": Method("least squares, mirrored", "", fit="least_squares", changes=(("mirror", True),)),
    # What is left of pretraining where the two robots' bodies differ.
    "core_finetune": Method(
        "pretrained recurrent core, fine-tuned", "pretrain_finetune", pretrained=True, carried="sidm"
    ),
    "core_frozen": Method(
        "pretrained recurrent core, frozen", "pretrain_finetune", pretrained=True, carried="sidm",
        changes=(("frozen", "sidm"),),
    ),
}  # fmt: skip

#: The two methods that the paper compares.
COMPARED = ("sidm", "novice_only")

#: What Figure 3 draws here: what a reviewer asks for first is in it from the start.
FIGURE3 = (*COMPARED, "pretrain_finetune")

#: Ends what figures call a method with the settings that did best with little data (`studies.tuning.LITTLE`).
FOR_LITTLE = "_for_little"

#: What might need less novice data than the paper's method and its strongest neighbour.
VARIANTS = (
    "copies", "copies_no_regularisation", "adapters", "tethered", "averaged", "mirrored", "corrected",
    "corrected_mirrored", "corrected_averaged",
)  # fmt: skip

#: Methods that mirror images might help as much, to stand beside.
MIRRORED = ("sidm_mirrored", "novice_only_mirrored", "least_squares_mirrored")

#: A rival that the claim about `corrected_averaged` is held against, with its aids.
RIVAL = "mirrored_averaged"

#: What is left of pretraining where the two robots' bodies differ, and all that such a pair can be learnt by.
CORES = ("core_finetune", "core_frozen")
ANY_BODIES = (*COMPARED, "no_regularisation", *CORES)

#: The other methods that SIDM is put among.
BASELINES = tuple(name for name in METHODS if name not in (*FIGURE3, *VARIANTS, *MIRRORED, *CORES, RIVAL))

PYTORCH_WEIGHTS, PATIENCE = "PyTorch's initial weights", "patience of 450,000 samples"
ONE_SYSTEM, ONE_OPTIMISER = "one system a batch", "matching by the prediction's optimiser"

#: Another choice than ours or the paper's, most of them the released code's -> changes of the preset, methods touched.
CHOICES: dict[str, tuple[dict[str, Any], tuple[str, ...]]] = {
    PYTORCH_WEIGHTS: ({"initialisation": "pytorch"}, FIGURE3),
    "loss averaged over components": ({"reduction": "mean"}, FIGURE3),
    "weight decay of 0.00001 in the gradient (L2)": ({"decay": "l2", "weight_decay": 1e-5}, FIGURE3),
    PATIENCE: ({"patience": 450_000}, FIGURE3),
    ONE_SYSTEM: ({"system_draw": "iteration"}, ("sidm",)),
    ONE_OPTIMISER: ({"matching_optimiser": "shared"}, ("sidm",)),
}


def _together(*names: str) -> dict[str, Any]:
    """The changes of several choices."""
    return {setting: value for name in names for setting, value in CHOICES[name][0].items()}


BOTH_OF_SIDM, ALL_RELEASED = "one system a batch and one optimiser", "all as released"

#: The released code's choices together; rates, batches, phases and patience stay as they were tuned here.
RELEASED: dict[str, tuple[dict[str, Any], tuple[str, ...]]] = {
    BOTH_OF_SIDM: (_together(ONE_SYSTEM, ONE_OPTIMISER), ("sidm",)),
    ALL_RELEASED: (_together(*(name for name in CHOICES if name != PATIENCE)), COMPARED),
}
