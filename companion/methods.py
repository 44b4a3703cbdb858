"""The methods: configurations of the one training loop. What tells them apart stands here, and what they were tuned to.

The preset's numbers are those of its `training`, with the changes of its `tuned` for a
method. The method `all_data`, training without SIDM on all novice data, is
`novice_only` at the largest size.
"""

from __future__ import annotations

from typing import Any

from sidm.rivals.methods import METHODS as LIBRARY
from sidm.rivals.methods import Method

#: Of training that begins with what an expert's data gave, and whose lowest loss may
#: come within a few batches: five times as many tests as otherwise, smoothed over as
#: long.
FINER_TESTS = {"test_interval": 5, "smoothing": 0.87}


#: The methods by name.
METHODS: dict[str, Method] = {
    # The paper's method, and its comparison on novice data alone (section 4).
    "sidm": LIBRARY["sidm"],
    "novice_only": LIBRARY["novice_only"],
    # Pretraining on the expert; section 4 says that the SIDM cannot be pretrained so.
    "pretrain_finetune": LIBRARY["pretrain_finetune"],
    "finetune_parts": Method(
        "pretraining + fine-tuning of encoder and decoder",
        "pretrain_finetune",
        pretrained=True,
        changes=(("frozen", "sidm"),),
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
    # The SIDM without its adversary, and with others.
    "no_regularisation": LIBRARY["no_regularisation"],
    "strong_matching": Method(
        "SIDM, stronger matching",
        "sidm",
        expert=True,
        regularise=True,
        changes=(("discriminator_iterations", 5), ("matching_iterations", 100)),
    ),
    "mmd": Method(
        "SIDM, MMD",
        "sidm",
        expert=True,
        regularise=True,
        changes=(("matching", "mmd"),),
    ),
    "coral": Method(
        "SIDM, CORAL",
        "sidm",
        expert=True,
        regularise=True,
        changes=(("matching", "coral"),),
    ),
    "gradient_reversal": Method(
        "SIDM, gradient reversal",
        "sidm",
        expert=True,
        regularise=True,
        changes=(("matching", "reversal"),),
    ),
    # One network for both systems.
    "pooled": Method("joint training (one network)", "sidm", expert=True, own="none"),
    "pooled_flag": Method(
        "joint training with a system flag", "sidm", expert=True, own="flag"
    ),
    # Beyond the paper: pretraining, and then...
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
    "tethered": Method(
        "pretraining + fine-tuning, tethered (L2-SP)",
        "pretrain_finetune",
        pretrained=True,
        changes=(("tether", 100.0),),
    ),
    "averaged": Method(
        "pretraining + fine-tuning, averaged",
        "pretrain_finetune",
        pretrained=True,
        all_changes=(("averaging", 0.99),),
    ),
    "mirrored": Method(
        "pretraining + fine-tuning, mirrored",
        "pretrain_finetune",
        pretrained=True,
        all_changes=(("mirror", True),),
    ),
    "mirrored_averaged": Method(
        "pretraining + fine-tuning, mirrored and averaged",
        "pretrain_finetune",
        pretrained=True,
        all_changes=(("mirror", True), ("averaging", 0.99)),
    ),
    "corrected": LIBRARY["corrected"],
    "corrected_mirrored": Method(
        "pretraining + least squares, mirrored",
        "",
        pretrained=True,
        residual=True,
        fit="least_squares",
        all_changes=(("mirror", True),),
    ),
    "corrected_averaged": Method(
        "pretraining + least squares, mirrored and averaged",
        "",
        pretrained=True,
        residual=True,
        fit="least_squares",
        all_changes=(("mirror", True), ("averaging", 0.99)),
    ),
    # What mirror images do for methods without pretraining.
    "sidm_mirrored": Method(
        "with SIDM, mirrored",
        "sidm",
        expert=True,
        regularise=True,
        changes=(("mirror", True),),
    ),
    "novice_only_mirrored": Method(
        "without SIDM, mirrored", "novice_only", changes=(("mirror", True),)
    ),
    "least_squares_mirrored": Method(
        "least squares, mirrored", "", fit="least_squares", changes=(("mirror", True),)
    ),
    # What is left of pretraining where the two robots' bodies differ.
    "core_finetune": LIBRARY["core_finetune"],
    "core_frozen": LIBRARY["core_frozen"],
}

#: The two methods that the paper compares.
COMPARED = ("sidm", "novice_only")

#: What Figure 3 draws here: what a reviewer asks for first is in it from the start.
FIGURE3 = (*COMPARED, "pretrain_finetune")

#: Ends what figures call a method with the settings that did best with little data
#: (`studies.tuning.LITTLE`).
FOR_LITTLE = "_for_little"

#: What might need less novice data than the paper's method and its strongest neighbour.
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

#: Methods that mirror images might help as much, to stand beside.
MIRRORED = ("sidm_mirrored", "novice_only_mirrored", "least_squares_mirrored")

#: A rival that the claim about `corrected_averaged` is held against, with its aids.
RIVAL = "mirrored_averaged"

#: What is left of pretraining where the two robots' bodies differ, and all that such a
#: pair can be learnt by.
CORES = ("core_finetune", "core_frozen")
ANY_BODIES = (*COMPARED, "no_regularisation", *CORES)

#: The other methods that SIDM is put among.
BASELINES = tuple(
    name
    for name in METHODS
    if name not in (*FIGURE3, *VARIANTS, *MIRRORED, *CORES, RIVAL)
)

PYTORCH_WEIGHTS, PATIENCE = "PyTorch's initial weights", "patience of 450,000 samples"
ONE_SYSTEM, ONE_OPTIMISER = (
    "one system a batch",
    "matching by the prediction's optimiser",
)

#: Another choice than ours or the paper's, most of them the released code's -> changes
#: of the preset, methods touched.
CHOICES: dict[str, tuple[dict[str, Any], tuple[str, ...]]] = {
    PYTORCH_WEIGHTS: ({"initialisation": "pytorch"}, FIGURE3),
    "loss averaged over components": ({"reduction": "mean"}, FIGURE3),
    "weight decay of 0.00001 in the gradient (L2)": (
        {"decay": "l2", "weight_decay": 1e-5},
        FIGURE3,
    ),
    PATIENCE: ({"patience": 450_000}, FIGURE3),
    ONE_SYSTEM: ({"system_draw": "iteration"}, ("sidm",)),
    ONE_OPTIMISER: ({"matching_optimiser": "shared"}, ("sidm",)),
}


def _together(*names: str) -> dict[str, Any]:
    """The changes of several choices."""
    return {
        setting: value for name in names for setting, value in CHOICES[name][0].items()
    }


BOTH_OF_SIDM, ALL_RELEASED = "one system a batch and one optimiser", "all as released"

#: The released code's choices together; rates, batches, phases and patience stay as
#: they were tuned here.
RELEASED: dict[str, tuple[dict[str, Any], tuple[str, ...]]] = {
    BOTH_OF_SIDM: (_together(ONE_SYSTEM, ONE_OPTIMISER), ("sidm",)),
    ALL_RELEASED: (
        _together(*(name for name in CHOICES if name != PATIENCE)),
        COMPARED,
    ),
}
