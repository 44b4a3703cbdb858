"""Settings of a trial's training: the library's, and those that single studies add to its loop."""

from __future__ import annotations

from typing import Any, Literal

from sidm.body import ROVER, Body
from sidm.config import ConfigError, config, refuse_below
from sidm.settings import Training


@config
class StudyTraining(Training):
    """Settings of one training run, with what baselines and variants change of the loop.

    Attributes:
        matching: what makes the latents alike: the paper's Algorithm 2, the same by the
            maximum mean discrepancy or by moments, or gradient reversal in Algorithm 1
        reversal_weight: of the discriminator's loss in the encoders' gradient, with
            matching='reversal'
        tether: share of the way back to their start that weights are pulled, a unit of
            learning rate
        averaging: weight of the past in the average of the weights that is tested and
            kept; 0: no average
        mirror: whether left and right of trajectories are exchanged, of each drawn with
            probability 0.5
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
                f"StudyTraining.averaging must be from 0 to below 1, which would never take in an update, "
                f"not {self.averaging}"
            )
        refuse_below(self, 0, "reversal_weight", "tether")
        if self.tether * self.learning_rate > 1:
            raise ConfigError(
                f"StudyTraining.tether must be at most 1 / learning_rate ({1 / self.learning_rate:g}), "
                f"not {self.tether}"
            )
        if (
            self.regularise
            and self.matching == "reversal"
            and self.system_draw == "iteration"
        ):
            raise ConfigError(
                "StudyTraining.matching='reversal' needs batches of both systems: system_draw='trajectory'"
            )

    def refuse_for(self, body: Body) -> None:
        """ConfigError naming the first setting that has a meaning for the paper's body alone."""
        super().refuse_for(body)
        if body != ROVER and self.mirror:
            raise ConfigError(
                f"StudyTraining.mirror knows left and right of the paper's robots alone, not of '{body.name}'"
            )

    def hooks(self) -> tuple[Any, ...]:
        """What these settings add to the training loop."""
        from companion.beyond.following import PullToStart, WeightAverage
        from companion.beyond.matching import (
            DISTANCES,
            DistanceMatching,
            GradientReversal,
        )
        from companion.beyond.mirror import Mirroring

        found: list[Any] = []
        if self.regularise and self.matching == "reversal":
            found.append(GradientReversal(self.reversal_weight))
        if self.regularise and self.matching in DISTANCES:
            found.append(DistanceMatching(self.matching))
        if self.tether:
            found.append(PullToStart(self.tether))
        if self.averaging:
            found.append(WeightAverage(self.averaging))
        if self.mirror:
            found.append(Mirroring())
        return tuple(found)
