"""Settings of training: those of the method, and those that only some studies use."""

from __future__ import annotations

from typing import Any, Literal

from sidm.body import ROVER, Body
from sidm.config import ConfigError, check_at_least, config
from sidm.settings import Training


@config
class StudyTraining(Training):
    """Settings of one training run, with those of baselines and variants.

    Attributes:
        matching: what makes the latents of both systems alike; 'adversary': the paper's
            Algorithm 2; 'mmd' and 'coral': Algorithm 2 with the maximum mean
            discrepancy or with moments; 'reversal': gradient reversal in Algorithm 1
        reversal_weight: weight of the discriminator's loss in the encoders' gradient,
            with matching='reversal'
        tether: pull of the weights towards their start (L2-SP): in each step, the share
            of the way back, divided by the learning rate
        averaging: weight of the past in the moving average of the weights, which is
            tested and kept; 0: no average
        mirror: whether trajectories are mirrored, left and right exchanged, each with
            probability 0.5 when it is drawn
    """

    matching: Literal["adversary", "mmd", "coral", "reversal"] = "adversary"
    reversal_weight: float = 0.1
    tether: float = 0.0
    averaging: float = 0.0
    mirror: bool = False

    def __post_init__(self) -> None:
        """Refuse values that no run can have."""
        super().__post_init__()
        if not 0 <= self.averaging < 1:
            raise ConfigError(
                "StudyTraining.averaging must be from 0 to below 1, which would never "
                f"take in an update, not {self.averaging}"
            )
        check_at_least(self, 0, "reversal_weight", "tether")
        if self.tether * self.learning_rate > 1:
            most = 1 / self.learning_rate
            raise ConfigError(
                f"StudyTraining.tether must be at most 1 / learning_rate ({most:g}), "
                f"not {self.tether}"
            )
        reversal = self.regularise and self.matching == "reversal"
        if reversal and self.system_draw == "iteration":
            raise ConfigError(
                "StudyTraining.matching='reversal' needs batches of both systems: "
                "system_draw='trajectory'"
            )

    def check_body(self, body: Body) -> None:
        """Refuse settings that make sense for the paper's body only.

        Raises:
            ConfigError: names the first such setting that `body` cannot have.
        """
        super().check_body(body)
        if body != ROVER and self.mirror:
            raise ConfigError(
                "StudyTraining.mirror knows left and right of the paper's robots "
                f"alone, not of '{body.name}'"
            )

    @property
    def plain(self) -> bool:
        """Whether these settings add nothing to the paper's method."""
        added = self.matching, self.tether, self.averaging, self.mirror
        return added == ("adversary", 0.0, 0.0, False)

    def trainer(self) -> type[Any]:
        """The class of a model in training with these settings."""
        from companion.extensions.trainer import StudyTrainer

        return StudyTrainer
