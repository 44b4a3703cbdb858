"""The loss of a model on drives that it has not learnt from, and its uncertainty."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from sidm.config import config, counted


@config
class Score:
    """Loss of a model on drives that it has not learnt from.

    Attributes:
        loss: mean loss of a step, equation (1)
        standard_error: standard error of the loss, from its spread between sessions, or
            between drives of a single session; None for a single drive
        mean_loss: loss of predicting the mean of the training drives; None if unknown
        drives: number of drives
        sessions: number of their sessions
        folds: number of models that were evaluated, each on the part of the drives that
            it did not learn from; 1 for a single model
    """

    loss: float
    standard_error: float | None
    mean_loss: float | None
    drives: int
    sessions: int
    folds: int = 1

    def __str__(self) -> str:
        error = self.standard_error
        spread = "" if error is None else f" ± {error:.2g} (standard error)"
        drives = counted(self.drives, "drive")
        sessions = counted(self.sessions, "session")
        folds = f", in {self.folds} folds" if self.folds > 1 else ""
        mean = self.mean_loss
        trivial = "" if mean is None else f"; predicting the mean: {mean:.3g}"
        return f"loss {self.loss:.3g}{spread} on {drives} of {sessions}{folds}{trivial}"


class DriveLosses(NamedTuple):
    """Losses of N drives, one entry for each; a loss is the mean over a drive's steps.

    Attributes:
        components: (N, Y), terms of equation (1); their sum is the loss
        mean_components: (N, Y), terms of predicting the mean; None if it is unknown
        steps: (N,), number of steps
        drives: (N,), names of the drives
        sessions: (N,), names of the sessions
    """

    components: np.ndarray
    mean_components: np.ndarray | None
    steps: np.ndarray
    drives: np.ndarray
    sessions: np.ndarray

    @property
    def losses(self) -> np.ndarray:
        """(N,), mean loss of a step of each drive."""
        return self.components.sum(1)

    @classmethod
    def joined(cls, parts: Sequence[DriveLosses]) -> DriveLosses:
        """The drives of several parts."""
        means = [p.mean_components for p in parts if p.mean_components is not None]
        return cls(
            np.concatenate([part.components for part in parts]),
            np.concatenate(means) if len(means) == len(parts) else None,
            *(
                np.concatenate([getattr(part, name) for part in parts])
                for name in ("steps", "drives", "sessions")
            ),
        )

    def score(self, folds: int = 1) -> Score:
        """The mean over all steps."""
        sessions, numbers = np.unique(self.sessions), np.arange(len(self.steps))
        groups = self.sessions if len(sessions) > 1 else numbers
        mean = self.mean_components
        return Score(
            loss=float(np.average(self.losses, weights=self.steps)),
            standard_error=standard_error(self.losses, groups, self.steps),
            mean_loss=None
            if mean is None
            else float(np.average(mean.sum(1), weights=self.steps)),
            drives=len(numbers),
            sessions=len(sessions),
            folds=folds,
        )


def standard_error(
    values: np.ndarray, groups: np.ndarray, weights: np.ndarray | None = None
) -> float | None:
    """Standard error of the weighted mean of values (N,) that are alike within a group.

    It comes from the groups' sums of deviations from the mean, so that groups may have
    different sizes; None for a single group.
    """
    names, number = np.unique(groups, return_inverse=True)
    count = len(names)
    if count < 2:
        return None
    weights = np.ones(len(values)) if weights is None else weights
    deviations = weights * (values - np.average(values, weights=weights))
    sums = np.bincount(number, deviations)
    variance = np.square(sums).sum() * count / (count - 1)
    return float(np.sqrt(variance) / weights.sum())
