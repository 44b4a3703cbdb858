"""Errors of predictions as tables, beside two predictions that learn nothing.

*Nothing changes* predicts that the robot stays where it is and that all other numbers
keep their values. *The mean* predicts the mean of the evaluated drives: of a component
of y one step ahead, and of the displacement, the turn and each number at a horizon.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd
import torch
from torch import Tensor

from ownrobot.fitting.windows import Steps
from sidm import rotations
from sidm.body import SI, Body
from sidm.learning.observation import heading_of, transition

COLUMNS = (
    "prediction",
    "quantity",
    "horizon",
    "unit",
    "rmse",
    "average",
    "median",
    "nothing_changes",
    "mean",
)
ONE_STEP, OPEN_LOOP = "one step", "open loop"


class Errors(NamedTuple):
    """Errors of one quantity, (N,) each, of a model and of two trivial predictions."""

    model: Tensor
    nothing_changes: Tensor
    mean: Tensor

    def row(
        self, prediction: str, quantity: str, horizon: float, unit: str
    ) -> tuple[str | float, ...]:
        """The errors' row, with the entries of COLUMNS."""
        rmse, nothing, mean = (_rms(errors) for errors in self)
        sizes = self.model.abs().double()
        own = rmse, float(sizes.mean()), float(sizes.median())
        return prediction, quantity, horizon, unit, *own, nothing, mean


def _rms(errors: Tensor) -> float:
    return float(errors.double().square().mean().sqrt())


def one_step_rows(
    steps: Sequence[Steps], states: Tensor, body: Body
) -> list[tuple[str | float, ...]]:
    """Rows of the errors of each component of y, one step ahead.

    The steps are predicted and actual transitions (K, Y) of each drive, the states
    (n, S) those before all n steps.
    """
    predicted, actual = (torch.cat(parts) for parts in zip(*steps, strict=True))
    still = transition(states, states, body)
    mean = actual.double().mean(0)
    # A pose has the same units as its change, which is what the model predicts.
    rows = []
    for number, (name, (_, unit)) in enumerate(
        zip(body.targets, body.state, strict=True)
    ):
        errors = Errors(
            *(
                guess[..., number] - actual[:, number]
                for guess in (predicted, still, mean)
            )
        )
        rows.append(errors.row(ONE_STEP, name, 1 / body.rate, SI.get(unit, unit)))
    return rows


def open_loop_rows(
    path: Tensor, actual: Tensor, body: Body
) -> list[tuple[str | float, ...]]:
    """Rows of the errors of predicted paths (N, K + 1, S), for each step ahead.

    The paths begin with the start of the recorded ones.
    """
    rows = []
    for name, unit, errors in _open_loop_errors(path, actual, body):
        for step in range(path.shape[1] - 1):
            at_step = Errors(*(values[:, step] for values in errors))
            rows.append(at_step.row(OPEN_LOOP, name, (step + 1) / body.rate, unit))
    return rows


def _open_loop_errors(
    path: Tensor, actual: Tensor, body: Body
) -> list[tuple[str, str, Errors]]:
    """Name, unit and errors (N, K) of position, heading and each other number."""
    path, actual, start = path[:, 1:], actual[:, 1:], actual[:, :1]
    result = []
    if body.pose != "none":
        axes = slice(0, 2 if body.pose == "planar" else 3)
        moved = _in_frame_of(start, actual[..., axes] - start[..., axes], body)
        position = Errors(
            (path - actual)[..., axes].norm(dim=-1),
            moved.norm(dim=-1),
            (moved - moved.mean(0)).norm(dim=-1),
        )
        predicted, heading, first = (
            heading_of(states, body) for states in (path, actual, start)
        )
        turn = rotations.wrap(heading - first)
        mean_turn = torch.atan2(turn.sin().mean(0), turn.cos().mean(0))
        turned = Errors(
            rotations.wrap(predicted - heading),
            turn,
            rotations.wrap(turn - mean_turn),
        )
        result += [("position", "m", position), ("heading", "rad", turned)]
    for number, (name, unit) in enumerate(body.columns, start=body.pose_size):
        values = actual[..., number]
        errors = Errors(
            path[..., number] - values,
            start[..., number] - values,
            values.mean(0) - values,
        )
        result.append((name, SI.get(unit, unit), errors))
    return result


def _in_frame_of(start: Tensor, displacement: Tensor, body: Body) -> Tensor:
    """Displacements (N, K, D), m, turned about the vertical into the start's frame."""
    level = rotations.turn(displacement[..., :2], -heading_of(start, body))
    return torch.cat([level, displacement[..., 2:]], -1)


def error_table(rows: Sequence[tuple[str | float, ...]]) -> pd.DataFrame:
    """The rows as a table."""
    return pd.DataFrame(rows, columns=list(COLUMNS))


def states_before(drives: Sequence[np.ndarray]) -> Tensor:
    """The states (n, S) before each step of drives, from states (K + 1, S) of each."""
    return torch.from_numpy(np.concatenate([states[:-1] for states in drives])).double()
