"""The methods: configurations of one training loop, and what tells them apart.

A preset has the numbers: its `training`, with the changes of its `tuned` for a method.
The method `all_data` in some figures, training without SIDM on all novice data, is
`novice_only` at the largest size.
"""

from __future__ import annotations

from typing import Any

from ownrobot.methods.registry import METHODS as LIBRARY
from ownrobot.methods.registry import Method

#: Settings for training that starts from weights learnt on an expert's data. The
#: lowest loss may come within a few batches, so tests are five times as frequent, and
#: smoothing covers the same time as without these settings.
FINER_TESTS = {"test_interval": 5, "smoothing": 0.87}


def _changed(name: str, label: str, **changes: Any) -> Method:
    """A method of the library with changed settings of its training."""
    return LIBRARY[name]._replace(label=label, changes=tuple(changes.items()))


def _aided(name: str, label: str, **aids: Any) -> Method:
    """A pretrained method of the library with aids, which its pretraining has, too."""
    return LIBRARY[name]._replace(label=label, all_changes=tuple(aids.items()))


#: The methods by name.
METHODS: dict[str, Method] = {
    # The paper's method, and its comparison on novice data alone (section 4).
    "sidm": LIBRARY["sidm"],
    "novice_only": LIBRARY["novice_only"],
    # Pretraining on the expert; section 4 says that this cannot pretrain the SIDM.
    "pretrain_finetune": LIBRARY["pretrain_finetune"],
    "finetune_parts": _changed(
        "pretrain_finetune",
        "pretraining + fine-tuning of encoder and decoder",
        frozen="sidm",
    ),
    "expert_only": LIBRARY["expert_only"],
    "residual": Method(
        "expert's model, corrected by a network",
        "novice_only",
        pretrained=True,
        residual=True,
    ),
    # No network for the novice at all.
    "least_squares": LIBRARY["least_squares"],
    # The SIDM without its adversary, and with other ways to match the latents.
    "no_regularisation": LIBRARY["no_regularisation"],
    "strong_matching": _changed(
        "sidm",
        "SIDM, stronger matching",
        discriminator_iterations=5,
        matching_iterations=100,
    ),
    "mmd": _changed("sidm", "SIDM, MMD", matching="mmd"),
    "coral": _changed("sidm", "SIDM, CORAL", matching="coral"),
    "gradient_reversal": _changed(
        "sidm", "SIDM, gradient reversal", matching="reversal"
    ),
    # One network for both systems.
    "pooled": Method("joint training (one network)", "sidm", expert=True, own="none"),
    "pooled_flag": Method(
        "joint training with a system flag", "sidm", expert=True, own="flag"
    ),
    # Beyond the paper: pretraining, followed by another training.
    "copies": Method(
        "pretraining + SIDM", "copies", expert=True, regularise=True, pretrained=True
    ),
    "copies_no_regularisation": Method(
        "pretraining + SIDM, no adversary", "copies", expert=True, pretrained=True
    ),
    "adapters": Method(
        "pretraining + joint training, own biases",
        "pretrain_finetune",
        expert=True,
        pretrained=True,
        own="biases",
    ),
    "tethered": _changed(
        "pretrain_finetune", "pretraining + fine-tuning, tethered (L2-SP)", tether=100.0
    ),
    "averaged": _aided(
        "pretrain_finetune", "pretraining + fine-tuning, averaged", averaging=0.99
    ),
    "mirrored": _aided(
        "pretrain_finetune", "pretraining + fine-tuning, mirrored", mirror=True
    ),
    "mirrored_averaged": _aided(
        "pretrain_finetune",
        "pretraining + fine-tuning, mirrored and averaged",
        mirror=True,
        averaging=0.99,
    ),
    "corrected": LIBRARY["corrected"],
    "corrected_mirrored": _aided(
        "corrected", "pretraining + least squares, mirrored", mirror=True
    ),
    "corrected_averaged": _aided(
        "corrected",
        "pretraining + least squares, mirrored and averaged",
        mirror=True,
        averaging=0.99,
    ),
    # Mirror images for methods without pretraining.
    "sidm_mirrored": _changed("sidm", "with SIDM, mirrored", mirror=True),
    "novice_only_mirrored": _changed(
        "novice_only", "without SIDM, mirrored", mirror=True
    ),
    "least_squares_mirrored": _changed(
        "least_squares", "least squares, mirrored", mirror=True
    ),
    # Pretraining of the shared part alone, for two robots whose bodies differ.
    "core_finetune": LIBRARY["core_finetune"],
    "core_frozen": LIBRARY["core_frozen"],
}

#: The two methods that the paper compares.
COMPARED = ("sidm", "novice_only")

#: The methods of Figure 3: the paper's two, and fine-tuning, the usual alternative.
FIGURE3 = (*COMPARED, "pretrain_finetune")

#: Suffix of a method's name in figures, for the settings that did best with little data
#: (`studies.tuning.LITTLE`).
FOR_LITTLE = "_for_little"

#: Methods that may need less novice data than the paper's method and fine-tuning.
VARIANTS = (
    "copies",
    "copies_no_regularisation",
    "adapters",
    "tethered",
    "averaged",
    "mirrored",
    "corrected",
    "corrected_mirrored",
    "corrected_averaged",
)

#: Methods with mirror images, which may help them as much as the VARIANTS.
MIRRORED = ("sidm_mirrored", "novice_only_mirrored", "least_squares_mirrored")

#: The method that the claim about `corrected_averaged` is tested against; it has the
#: same aids.
RIVAL = "mirrored_averaged"

#: Methods that pretrain the shared part alone.
CORES = ("core_finetune", "core_frozen")

#: Methods for two robots whose bodies differ.
ANY_BODIES = (*COMPARED, "no_regularisation", *CORES)

#: The other methods that SIDM is compared with.
BASELINES = tuple(
    name
    for name in METHODS
    if name not in (*FIGURE3, *VARIANTS, *MIRRORED, *CORES, RIVAL)
)

PYTORCH_WEIGHTS = "PyTorch's initial weights"
LONG_PATIENCE = "patience of 450,000 samples"
ONE_SYSTEM = "one system a batch"
ONE_OPTIMISER = "matching by the prediction's optimiser"

#: Choices that differ from ours or the paper's, most of them the released code's, by
#: name: changes of the preset, and the methods that they concern.
CHOICES: dict[str, tuple[dict[str, Any], tuple[str, ...]]] = {
    PYTORCH_WEIGHTS: ({"initialisation": "pytorch"}, FIGURE3),
    "loss averaged over components": ({"reduction": "mean"}, FIGURE3),
    "weight decay of 0.00001 in the gradient (L2)": (
        {"decay": "l2", "weight_decay": 1e-5},
        FIGURE3,
    ),
    LONG_PATIENCE: ({"patience": 450_000}, FIGURE3),
    ONE_SYSTEM: ({"system_draw": "iteration"}, ("sidm",)),
    ONE_OPTIMISER: ({"matching_optimiser": "shared"}, ("sidm",)),
}


def _together(*names: str) -> dict[str, Any]:
    """The changes of several choices in one dictionary."""
    return {
        setting: value for name in names for setting, value in CHOICES[name][0].items()
    }


BOTH_OF_SIDM = "one system a batch and one optimiser"
ALL_RELEASED = "all as released"

_RELEASED_CHOICES = [name for name in CHOICES if name != LONG_PATIENCE]

#: Several of the released code's choices together, by name as in CHOICES. Learning
#: rates, batches, phases and patience stay as they were tuned here.
RELEASED: dict[str, tuple[dict[str, Any], tuple[str, ...]]] = {
    BOTH_OF_SIDM: (_together(ONE_SYSTEM, ONE_OPTIMISER), ("sidm",)),
    ALL_RELEASED: (_together(*_RELEASED_CHOICES), COMPARED),
}
