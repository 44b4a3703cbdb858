"""The methods that a robot is learnt by: configurations of the one training loop, or a closed form."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, Literal, NamedTuple, TypeVar

from sidm.config import replace
from sidm.settings import Training

T = TypeVar("T", bound=Training)


class Method(NamedTuple):
    """A configuration of the one training loop."""

    label: str  # for figures and tables
    #: whose tuned settings it has; '' where nothing of the training loop is used
    tuned_as: str
    #: whether it learns from the expert's data too, with the training's p_e
    expert: bool = False
    regularise: bool = False  # whether the latents are made alike
    #: whether it starts from weights that learnt from the expert alone
    pretrained: bool = False
    #: what of those weights it starts from; 'sidm': the shared part alone
    carried: Literal["all", "sidm"] = "all"
    residual: bool = False  # whether it learns to correct them instead
    fit: Literal["gradients", "least_squares"] = "gradients"  # what it learns by
    #: what each system has of encoder and decoder for itself
    own: Literal["all", "biases", "flag", "none"] = "all"
    changes: tuple[tuple[str, Any], ...] = ()  # of its training
    #: of its training, and of its pretraining
    all_changes: tuple[tuple[str, Any], ...] = ()

    def training(self, base: T, tuned: Mapping[str, Any] = MappingProxyType({})) -> T:
        """The method's training on the novice.

        Args:
            base: the settings of every method; `p_expert` holds where the method learns
                from the expert's data.
            tuned: settings that the method was tuned to, in place of the base's.
        """
        p_expert = base.p_expert if self.expert else 0.0
        values = dict(tuned) | dict(self.all_changes) | dict(self.changes)
        return replace(
            base, **({"p_expert": p_expert, "regularise": self.regularise} | values)
        )

    def pretraining(
        self, base: T, tuned: Mapping[str, Any] = MappingProxyType({})
    ) -> T | None:
        """The method's training on the expert alone; None for a method that begins afresh."""
        if not self.pretrained:
            return None
        return replace(
            base,
            **(dict(tuned) | dict(self.all_changes)),
            p_expert=0.0,
            regularise=False,
        )


#: The methods that the library offers, by name.
METHODS: dict[str, Method] = {
    # The paper's method, and its comparison on novice data alone (section 4).
    "sidm": Method("with SIDM", "sidm", expert=True, regularise=True),
    "novice_only": Method("without SIDM", "novice_only"),
    "no_regularisation": Method("SIDM, no adversary", "sidm", expert=True),
    # Pretraining on the expert; section 4 says that the SIDM cannot be pretrained so.
    "pretrain_finetune": Method(
        "pretraining + fine-tuning", "pretrain_finetune", pretrained=True
    ),
    "expert_only": Method(
        "expert's model as it is",
        "pretrain_finetune",
        pretrained=True,
        changes=(("max_samples", 0),),
    ),
    # What is left of pretraining where the two robots' bodies differ.
    "core_finetune": Method(
        "pretrained recurrent core, fine-tuned",
        "pretrain_finetune",
        pretrained=True,
        carried="sidm",
    ),
    "core_frozen": Method(
        "pretrained recurrent core, frozen",
        "pretrain_finetune",
        pretrained=True,
        carried="sidm",
        changes=(("frozen", "sidm"),),
    ),
    # No network for the novice, or none but the expert's.
    "least_squares": Method("least squares", "", fit="least_squares"),
    "corrected": Method(
        "pretraining + least squares",
        "",
        pretrained=True,
        residual=True,
        fit="least_squares",
    ),
}
