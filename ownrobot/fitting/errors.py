"""Losses and errors of predictions, beside two predictions that learn nothing.

*Nothing changes* predicts that the robot stays where it is and that all other numbers
keep their values. *The mean* predicts the mean of the evaluated drives: of a component
of y one step ahead, and of the displacement, the turn and each number at a horizon.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import torch
from torch import Tensor

from ownrobot.fitting.windows import Steps
from sidm import rotations
from sidm.body import SI, Body
from sidm.config import config, counted
from sidm.drives import Drive
from sidm.learning.observation import heading_of, transition

if TYPE_CHECKING:
    import pandas as pd

ONE_STEP, OPEN_LOOP = "one step", "open loop"


@config
class Score:
    """Loss of a model on drives that it has not learnt from."""

    loss: float  # mean loss of a step, equation (1)
    #: from the spread between sessions, or between drives of a single session; None
    #: for a single drive
    standard_error: float | None
    mean_loss: float | None  # of predicting the mean of the training drives, if known
    drives: int
    sessions: int
    #: number of models, each evaluated on what it did not learn from
    folds: int = 1

    def __str__(self) -> str:
        error, mean = self.standard_error, self.mean_loss
        spread = "" if error is None else f" ± {error:.2g} (standard error)"
        drives = counted(self.drives, "drive")
        sessions = counted(self.sessions, "session")
        folds = f", in {self.folds} folds" if self.folds > 1 else ""
        trivial = "" if mean is None else f"; predicting the mean: {mean:.3g}"
        return f"loss {self.loss:.3g}{spread} on {drives} of {sessions}{folds}{trivial}"


def score_of(losses: pd.DataFrame, folds: int = 1) -> Score:
    """The mean over all steps of drives, whose losses are those of `Model.losses`."""
    sessions = losses.session.nunique()
    groups = losses.session if sessions > 1 else losses.index
    means = losses["mean"]
    return Score(
        loss=float(np.average(losses.loss, weights=losses.steps)),
        standard_error=standard_error(losses.loss, groups, losses.steps),
        mean_loss=None
        if means.isna().any()
        else float(np.average(means, weights=losses.steps)),
        drives=len(losses),
        sessions=sessions,
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


def one_step_rows(
    steps: Sequence[Steps], drives: Sequence[Drive]
) -> Iterator[dict[str, Any]]:
    """Rows of the errors of each component of y, one step ahead.

    The steps are predicted and actual transitions (K, Y) of each of the drives.
    """
    body = drives[0].body
    predicted, actual = (torch.cat(parts) for parts in zip(*steps, strict=True))
    before = np.concatenate([drive.states[:-1] for drive in drives])
    states = torch.from_numpy(before).double()
    guesses = predicted, transition(states, states, body), actual.double().mean(0)
    # A pose has the same units as its change, which is what the model predicts.
    for number, (name, (_, unit)) in enumerate(
        zip(body.targets, body.state, strict=True)
    ):
        errors = [guess[..., number] - actual[:, number] for guess in guesses]
        yield _row(ONE_STEP, name, 1 / body.rate, unit, errors)


def open_loop_rows(
    path: Tensor, actual: Tensor, body: Body
) -> Iterator[dict[str, Any]]:
    """Rows of the errors of predicted paths (N, K + 1, S), for each step ahead.

    The paths begin with the start of the recorded ones.
    """
    for name, unit, errors in _open_loop_errors(path, actual, body):
        for step in range(path.shape[1] - 1):
            at_step = [values[:, step] for values in errors]
            yield _row(OPEN_LOOP, name, (step + 1) / body.rate, unit, at_step)


def _row(
    prediction: str, quantity: str, horizon: float, unit: str, errors: Sequence[Tensor]
) -> dict[str, Any]:
    """A row of errors (N,) of a model, of no change and of the mean."""
    rmse, nothing, mean = (float(e.double().square().mean().sqrt()) for e in errors)
    sizes = errors[0].abs().double()
    return {
        "prediction": prediction,
        "quantity": quantity,
        "horizon": horizon,
        "unit": SI.get(unit, unit),
        "rmse": rmse,
        "average": float(sizes.mean()),
        "median": float(np.median(sizes.numpy())),
        "nothing_changes": nothing,
        "mean": mean,
    }


def _open_loop_errors(
    path: Tensor, actual: Tensor, body: Body
) -> Iterator[tuple[str, str, tuple[Tensor, ...]]]:
    """Name, unit and errors, (N, K) each, of position, heading and other numbers."""
    path, actual, start = path[:, 1:], actual[:, 1:], actual[:, :1]
    if body.pose != "none":
        axes = slice(0, 2 if body.pose == "planar" else 3)
        predicted, heading, first = (
            heading_of(states, body) for states in (path, actual, start)
        )
        moved = actual[..., axes] - start[..., axes]  # is turned into the start's frame
        moved = torch.cat([rotations.turn(moved[..., :2], -first), moved[..., 2:]], -1)
        off = (path - actual)[..., axes], moved, moved - moved.mean(0)
        yield "position", "m", tuple(error.norm(dim=-1) for error in off)
        turn = rotations.wrap(heading - first)
        mean = torch.atan2(turn.sin().mean(0), turn.cos().mean(0))
        turned = rotations.wrap(predicted - heading), turn, rotations.wrap(turn - mean)
        yield "heading", "rad", turned
    for number, (name, unit) in enumerate(body.columns, start=body.pose_size):
        values = actual[..., number]
        guesses = path[..., number], start[..., number], values.mean(0)
        yield name, unit, tuple(guess - values for guess in guesses)
