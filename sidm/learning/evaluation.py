"""How good a model is: the validation loss by component, and rollouts of many steps (section 5, Figure 4)."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from torch import Tensor

from sidm import rotations
from sidm.body import ROVER, Body
from sidm.learning.dataset import Windows
from sidm.learning.losses import component_losses
from sidm.learning.model import Predictor
from sidm.learning.observation import (
    encode_inputs,
    heading_of,
    integrate,
    robot_centred_map,
)

EVALUATION_BATCH = 32  # trajectories at a time where no gradient is needed


def mean_loss(model: Predictor, motion: Windows, role: str = "novice") -> float:
    """Equation (1) averaged over the steps of `motion`."""
    total = sum(
        float(terms.sum(-1).double().sum()) for terms in _terms(model, motion, role)
    )
    return total / motion.targets[..., 0].numel()


def validation_loss(
    model: Predictor,
    motion: Windows,
    role: str = "novice",
    weights: Tensor | None = None,
) -> Tensor:
    """Mean over all steps of `motion` of each term of equation (1): (Y,) float64; their sum is the loss.

    The `weights` (Y,) of the components are those that the model was trained with
    unless given.
    """
    parts = (
        terms.double().sum((0, 1)).cpu()
        for terms in _terms(model, motion, role, weights)
    )
    return sum(parts, torch.zeros(())) / motion.targets[..., 0].numel()


@torch.inference_mode()
def _terms(
    model: Predictor, motion: Windows, role: str, weights: Tensor | None = None
) -> list[Tensor]:
    """The terms of equation (1), (B, T, Y), batch by batch."""
    parts = (part.to(model.device) for part in motion.split(EVALUATION_BATCH))
    weights = model.loss_weights(role) if weights is None else weights.to(model.device)
    return [
        component_losses(model(role, part.inputs, part.maps)[0], part.targets, weights)
        for part in parts
    ]


def rollout(
    model: Predictor,
    heights: Tensor | np.ndarray | None,
    state: Tensor,
    actions: Tensor,
    pixels: int,
    role: str = "novice",
    spacing: float = 0.1,
    body: Body = ROVER,
    memory: Any = None,
) -> Tensor:
    """Predict many steps ahead: each prediction is integrated and the next one starts from there.

    The SIDM's memory is carried along, and the height map is sampled at each predicted
    pose.

    Args:
        model: the trained model.
        heights: (H, W), m; or (B, H, W), a terrain each; None for a body without a map.
        state: (S,), or (B, S): where the robots start.
        actions: (K, A), or (B, K, A).
        pixels: P of the model's maps.
        role: whose encoder and decoder.
        spacing: of the terrain's grid, m.
        body: what states and actions are made of; S is 13 and A is 2 by default.
        memory: of the model before the start; none by default.

    Returns:
        Predicted states (K + 1, S), or (B, K + 1, S), the given one first, in the type
        of `state`.

    Raises:
        ValueError: shapes that do not fit each other.
    """
    state, actions = torch.as_tensor(state), torch.as_tensor(actions)
    single = state.ndim == 1
    if single:
        state, actions = state[None], actions[None]
    grounds = None if heights is None else torch.as_tensor(heights)
    if single and grounds is not None:
        grounds = grounds[None]
    _expect_rollout(grounds, state, actions, body)
    states = [state.double()]
    with torch.inference_mode():
        for action in actions.double().unbind(1):
            # (B, 1, X)
            inputs = encode_inputs(states[-1], action, body).float()[:, None]
            # (B, 1, P, P)
            maps = _maps_at(grounds, states[-1], body, pixels, spacing)[:, None]
            predicted, memory = model(
                role, inputs.to(model.device), maps.to(model.device), memory
            )
            states.append(integrate(states[-1], predicted[:, 0].cpu().double(), body))
    path = torch.stack(states, dim=1).to(state.dtype).clone()
    return path[0] if single else path


def _maps_at(
    grounds: Tensor | None, states: Tensor, body: Body, pixels: int, spacing: float
) -> Tensor:
    """Maps (B, P, P) of states (B, S), float16; P is 0 without a map."""
    if not body.map_size:
        return torch.zeros(len(states), 0, 0, dtype=torch.float16)
    assert grounds is not None
    return robot_centred_map(
        grounds, states, body.pixels(pixels), body.map_size, spacing, body
    ).half()


def _expect_rollout(
    grounds: Tensor | None, state: Tensor, actions: Tensor, body: Body
) -> None:
    """ValueError naming all shapes unless they fit each other and the body."""
    given = [
        one
        for one in (grounds if body.map_size else None, state, actions)
        if one is not None
    ]
    dimensions = [one.ndim for one in given] == [3, 2, 3][-2 - bool(body.map_size) :]
    sizes = (state.shape[-1], actions.shape[-1]) == (len(body.state), len(body.actions))
    if not (dimensions and sizes and len({len(one) for one in given}) == 1):
        wanted = f"state (B, {len(body.state)}) and actions (B, K, {len(body.actions)}) of one B"
        *first, last = (str(tuple(one.shape)) for one in given)
        shapes = f"{', '.join(first)} and {last}"
        raise ValueError(
            f"{'heights (B, H, W), ' if body.map_size else ''}{wanted}, not {shapes}"
        )


def rollout_errors(
    predicted: Tensor, actual: Tensor, body: Body = ROVER
) -> tuple[Tensor, Tensor]:
    """How far predicted paths stray from the actual ones, step by step.

    Args:
        predicted: states (..., K + 1, S), the common start first.
        actual: the same shape.
        body: what a state is made of; it has a pose.

    Returns:
        Distance between positions, m, and absolute difference of headings, rad in [0,
        pi], each (..., K): without the start.

    Raises:
        ValueError: the shapes differ or are not of states.
    """
    if (
        predicted.shape != actual.shape
        or predicted.ndim < 2
        or predicted.shape[-1] != len(body.state)
    ):
        raise ValueError(
            f"predicted and actual states (..., K + 1, {len(body.state)}), not {tuple(predicted.shape)} and "
            f"{tuple(actual.shape)}"
        )
    predicted, actual = predicted[..., 1:, :].double(), actual[..., 1:, :].double()
    place = slice(0, 2 if body.pose == "planar" else 3)
    position = (predicted[..., place] - actual[..., place]).norm(dim=-1)
    return position, rotations.wrap(
        heading_of(predicted, body) - heading_of(actual, body)
    ).abs()
