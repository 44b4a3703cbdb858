"""How the model of a trial is judged: the loss of a step, and open-loop errors.

The drives that judge are predicted one after the other, without memory of the drives
before. What a model may not do is refused.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import torch
from torch import Tensor

from companion.tasks.catalogue import TaskData
from companion.tasks.methods import FittedModel
from sidm.body import Body
from sidm.drives import Drive
from sidm.learning.evaluation import rollout_errors
from sidm.learning.observation import integrate, transition
from sidm.learning.units import Standardisation, loss_weights

AHEAD = 1.0  # s, of the open-loop errors
START = 20  # step at which open-loop predictions start, or fewer in shorter drives
OPEN_LOOP_DRIVES = 64  # drives that are predicted open loop
CHECKED = 3  # drives at which the use of later states is looked for
PEEKED = 1e-3  # of a component's standard deviation; rounding changes far less


class Refused(Exception):
    """A model that does not count; its arguments are status and message."""


def evaluate(model: FittedModel, motion: TaskData) -> dict[str, Any]:
    """Loss and open-loop errors of a model on the drives that judge, or Refused.

    They are fields of an `EntryResult`: `loss` and `components`, and where the body has
    a pose `position` and `heading`.
    """
    drives, body = motion.validation, motion.validation[0].body
    targets = [_targets(drive) for drive in drives]
    std = torch.cat(targets).std(0, correction=0)
    units = Standardisation.none(body)._replace(target_std=std)
    weights = loss_weights(body, units)
    predictions = [_predictions(model, drive) for drive in drives]
    errors = torch.cat([torch.from_numpy(p) for p in predictions]) - torch.cat(targets)
    terms = errors.square() if weights is None else errors.square() * weights
    _refuse_peeking(model, drives, predictions, std.numpy())
    components = terms.mean(0).tolist()
    values = {"loss": sum(components), "components": components}
    return values | _open_loop(model, drives, body)


def _targets(drive: Drive) -> Tensor:
    """Transitions (K, Y), float64, of a drive's steps."""
    states = torch.from_numpy(drive.states).double()
    return transition(states[:-1], states[1:], drive.body)


def _predictions(model: FittedModel, drive: Drive) -> np.ndarray:
    """Predicted transitions (K, Y), float64, checked."""
    predicted = np.asarray(model.predict(drive), float)
    _refuse_shape(predicted, "predictions", len(drive), len(drive.body.targets))
    if not np.isfinite(predicted).all():
        raise Refused("not finite", f"{drive.name}: a prediction is not finite")
    return predicted


def _refuse_shape(values: np.ndarray, what: str, *expected: int) -> None:
    if values.shape != expected:
        text = f"{what} of shape {values.shape}, not {expected}"
        raise Refused("wrong shape", text)


def _refuse_peeking(
    model: FittedModel,
    drives: Sequence[Drive],
    predictions: Sequence[np.ndarray],
    std: np.ndarray,
) -> None:
    """Refuse a model whose prediction of a step depends on what comes after.

    A model that draws without a seed is refused first: nothing could be told of it.
    """
    for drive, full in zip(drives[:CHECKED], predictions, strict=False):
        again = _predictions(model, drive)
        if (np.abs(again - full) > PEEKED * std).any():
            raise Refused(
                "not reproducible", f"{drive.name}: its predictions differ if repeated"
            )
        for step in (len(drive) // 3, len(drive) - 1):
            states = drive.states[: step + 2].copy()
            states[-1] = states[-2]  # the state after is not known
            actions = drive.actions[: step + 1]
            hidden = Drive(states, actions, drive.body, drive.ground, name=drive.name)
            difference = np.abs(_predictions(model, hidden)[step] - full[step])
            if (difference > PEEKED * std).any():
                raise Refused(
                    "peeked",
                    f"{drive.name}: the prediction of step {step} changes with the "
                    "state after it",
                )


def _open_loop(
    model: FittedModel, drives: Sequence[Drive], body: Body
) -> dict[str, float]:
    """Errors of position and heading after AHEAD seconds; {} without a pose."""
    steps = round(AHEAD * body.rate)
    chosen = [d for d in drives if len(d) >= steps][:OPEN_LOOP_DRIVES]
    if body.pose == "none" or not chosen:
        return {}
    paths, actual = [], []
    for drive in chosen:
        first = min(START, len(drive) - steps)
        paths.append(torch.from_numpy(_path(model, drive, first, steps)))
        actual.append(torch.from_numpy(drive.states[first : first + steps + 1]))
    errors = rollout_errors(torch.stack(paths), torch.stack(actual).double(), body)
    position, heading = (float(e[:, -1].square().mean().sqrt()) for e in errors)
    if not np.isfinite([position, heading]).all():
        raise Refused("not finite", "an open-loop prediction is not finite")
    return {"position": position, "heading": heading}


def _path(model: FittedModel, drive: Drive, first: int, steps: int) -> np.ndarray:
    """Open-loop states (K + 1, S), float64, of a part of a drive, checked."""
    if not hasattr(model, "rollout"):
        return _derived_rollout(model, drive, first, steps)
    actions = drive.actions[first : first + steps]
    path = np.asarray(model.rollout(drive.states[first], actions, drive.ground), float)
    _refuse_shape(path, "a rollout", steps + 1, drive.states.shape[1])
    return path


def _derived_rollout(
    model: FittedModel, drive: Drive, first: int, steps: int
) -> np.ndarray:
    """Open-loop states (K + 1, S) of a model that has no `rollout` of its own.

    Each step is predicted by itself, so that the model has no memory.
    """
    state = drive.states[first].astype(float)
    path = [state]
    for step in range(first, first + steps):
        action = drive.actions[step : step + 1]
        one = Drive(np.stack([state, state]), action, drive.body, drive.ground)
        transition = torch.from_numpy(_predictions(model, one))
        state = integrate(torch.from_numpy(state)[None], transition, drive.body)[0]
        state = state.numpy()
        path.append(state)
    return np.stack(path)
