"""The methods of learning a robot: settings of one training loop, or no network."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, Literal, NamedTuple, TypeVar

from sidm.config import replace
from sidm.settings import Training

T = TypeVar("T", bound=Training)
#: Settings of Algorithm 2, and of drawing the expert's data, by what they need.
ADVERSARY = {
    "discriminator_hidden",
    "discriminator_batch",
    "discriminator_iterations",
    "discriminator_draw",
    "matching_batch",
    "matching_iterations",
    "matching_optimiser",
}
DRAWING = {"p_expert", "system_draw"}
Fit = Literal[
    "gradients", "least_squares", "kinematics", "trees", "gaussian_process", "trivial"
]


class Method(NamedTuple):
    """A method of learning a robot."""

    label: str  # name in figures and tables
    tuned_as: str  # the method whose tuned settings it has; '' without training loop
    expert: bool = False  # whether it learns from the expert's data too, with p_e
    regularise: bool = False  # whether Algorithm 2 makes the systems' latents similar
    pretrained: bool = False  # whether it starts from weights of the expert alone
    carried: Literal["all", "sidm"] = "all"  # which; 'sidm': the shared part alone
    #: whether it learns a correction of the expert's model instead: of the pretrained
    #: network, of its trees for trees, or else of its least squares
    residual: bool = False
    #: whether it learns from the samples of both robots as one, with an input that
    #: tells them apart
    pooled: bool = False
    fit: Fit = "gradients"  # how it learns
    #: which parts of encoder and decoder each system has for itself, as `Network.own`
    own: Literal["all", "biases", "flag", "none"] = "all"
    changes: tuple[tuple[str, Any], ...] = ()  # settings of its training that differ
    all_changes: tuple[tuple[str, Any], ...] = ()  # of its pretraining, too

    @property
    def needs_expert(self) -> bool:
        """Whether it cannot learn from the novice's data alone."""
        return self.expert or self.pretrained or self.residual or self.pooled

    @property
    def needs_one_body(self) -> bool:
        """Whether novice and expert must have the same body."""
        copied = self.pretrained and self.carried == "all"
        return self.residual or self.pooled or copied

    def uses(self, setting: str) -> bool:
        """Whether a setting of the networks or the training changes what it learns."""
        if self.fit != "gradients" and not self.pretrained:
            maps = "trees", "gaussian_process"  # what sees height maps
            return setting == "pixels" and self.fit in maps
        if setting in ADVERSARY:
            return self.regularise
        return self.expert or setting not in DRAWING

    def training(self, base: T, tuned: Mapping[str, Any] = MappingProxyType({})) -> T:
        """Settings of the method's training on the novice, from those that all share.

        The base's `p_expert` counts only if the method learns from the expert's data;
        tuned values replace the base's.
        """
        p_expert = base.p_expert if self.expert else 0.0
        values = {"p_expert": p_expert, "regularise": self.regularise} | dict(tuned)
        return replace(base, **(values | dict(self.all_changes) | dict(self.changes)))

    def pretraining(
        self, base: T, tuned: Mapping[str, Any] = MappingProxyType({})
    ) -> T | None:
        """Settings of the training on the expert alone; None without pretraining."""
        if not self.pretrained:
            return None
        values = dict(tuned) | dict(self.all_changes)
        return replace(base, **values, p_expert=0.0, regularise=False)


#: The methods of learning a robot, by name.
METHODS: dict[str, Method] = {
    # The paper's method, and its baseline on the novice's data alone (section 4).
    "sidm": Method("with SIDM", "sidm", expert=True, regularise=True),
    "novice_only": Method("without SIDM", "novice_only"),
    "no_regularisation": Method("SIDM, no adversary", "sidm", expert=True),
    # Pretraining on the expert; section 4 says that the SIDM cannot be pretrained on
    # one expert alone.
    "pretrain_finetune": Method(
        "pretraining + fine-tuning", "pretrain_finetune", pretrained=True
    ),
    "expert_only": Method(
        "expert's model as it is",
        "pretrain_finetune",
        pretrained=True,
        changes=(("max_samples", 0),),
    ),
    # Pretraining of the shared part alone, for robots whose bodies differ.
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
    # No network for the novice, or only the expert's.
    "least_squares": Method("least squares", "", fit="least_squares"),
    "corrected": Method(
        "pretraining + least squares",
        "",
        pretrained=True,
        residual=True,
        fit="least_squares",
    ),
    "least_squares_corrected": Method(
        "expert's least squares, corrected", "", residual=True, fit="least_squares"
    ),
    "least_squares_pooled": Method(
        "least squares of both robots", "", pooled=True, fit="least_squares"
    ),
    # Boosted trees, of the novice alone, on those of the expert, or of both robots.
    "trees": Method("boosted trees", "", fit="trees"),
    "trees_corrected": Method(
        "expert's trees, corrected by trees", "", residual=True, fit="trees"
    ),
    "trees_pooled": Method(
        "boosted trees of both robots", "", pooled=True, fit="trees"
    ),
    # Gaussian processes: of the novice alone, on the expert's least squares, which are
    # as good a base as its Gaussian processes and know more beyond its samples, or of
    # both robots.
    "gp": Method("Gaussian process", "", fit="gaussian_process"),
    "gp_corrected": Method(
        "expert's least squares, corrected by a Gaussian process",
        "",
        residual=True,
        fit="gaussian_process",
    ),
    "gp_pooled": Method(
        "Gaussian process of both robots", "", pooled=True, fit="gaussian_process"
    ),
    # What a roboticist writes down without learning.
    "differential_drive": Method("differential drive", "", fit="kinematics"),
    "rotation_centres": Method("centres of rotation", "", fit="kinematics"),
    "ackermann": Method("kinematic bicycle", "", fit="kinematics"),
    # Yardsticks.
    "nothing_changes": Method("nothing changes", "", fit="trivial"),
    "mean": Method("mean of the training data", "", fit="trivial"),
}
