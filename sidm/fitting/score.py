"""The loss of a model on drives that it has not learnt from, and its uncertainty."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from sidm.config import config


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
        count = f"{self.drives} drives of {self.sessions} sessions"
        folds = f", in {self.folds} folds" if self.folds > 1 else ""
        mean = self.mean_loss
        trivial = "" if mean is None else f"; predicting the mean: {mean:.3g}"
        return f"loss {self.loss:.3g}{spread} on {count}{folds}{trivial}"


class WindowLosses(NamedTuple):
    """Losses of N windows, one entry for each, mean over the window's steps."""

    losses: np.ndarray  # (N,)
    mean_losses: np.ndarray | None  # (N,) of predicting the mean
    drives: np.ndarray  # (N,) name of the drive
    sessions: np.ndarray  # (N,) name of the session

    @classmethod
    def joined(cls, parts: Sequence[WindowLosses]) -> WindowLosses:
        """The windows of several parts."""
        means = [part.mean_losses for part in parts if part.mean_losses is not None]
        return cls(
            np.concatenate([part.losses for part in parts]),
            np.concatenate(means) if means else None,
            np.concatenate([part.drives for part in parts]),
            np.concatenate([part.sessions for part in parts]),
        )

    def score(self, folds: int = 1) -> Score:
        """The mean over the windows, which are of equal length."""
        drives, sessions = np.unique(self.drives), np.unique(self.sessions)
        groups = self.sessions if len(sessions) > 1 else self.drives
        mean = self.mean_losses
        return Score(
            loss=float(self.losses.mean()),
            standard_error=standard_error(self.losses, groups),
            mean_loss=None if mean is None else float(mean.mean()),
            drives=len(drives),
            sessions=len(sessions),
            folds=folds,
        )


def standard_error(values: np.ndarray, groups: np.ndarray) -> float | None:
    """Standard error of the mean of values (N,) that are alike within a group.

    It comes from the groups' sums of deviations from the mean, so that groups may have
    different sizes; None for a single group.
    """
    names, number = np.unique(groups, return_inverse=True)
    count = len(names)
    if count < 2:
        return None
    sums = np.bincount(number, values - values.mean())
    variance = np.square(sums).sum() * count / (count - 1)
    return float(np.sqrt(variance) / len(values))
