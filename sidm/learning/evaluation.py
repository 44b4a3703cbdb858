"""How good a model is: validation losses and rollouts (section 5, Figure 4)."""

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
    require_shape,
    robot_centred_map,
)

EVALUATION_BATCH = 32  # trajectories in a batch where no gradient is needed


def mean_loss(model: Predictor, windows: Windows, role: str = "novice") -> float:
    """Equation (1), averaged over all steps of the windows of one system."""
    batches = _terms(model, windows, role)
    total = sum(float(terms.sum(-1).double().sum()) for terms in batches)
    return total / windows.targets[..., 0].numel()


def validation_loss(
    model: Predictor,
    windows: Windows,
    role: str = "novice",
    weights: Tensor | None = None,
) -> Tensor:
    """The terms of equation (1), (Y,) float64, each averaged over all steps.

    `weights` (Y,) are factors of the terms, by default those of the model's training.
    """
    batches = _terms(model, windows, role, weights)
    totals = (terms.double().sum((0, 1)).cpu() for terms in batches)
    return sum(totals, torch.zeros(())) / windows.targets[..., 0].numel()


@torch.inference_mode()
def _terms(
    model: Predictor, windows: Windows, role: str, weights: Tensor | None = None
) -> list[Tensor]:
    """The terms of equation (1), (B, T, Y), batch by batch."""
    device = model.device
    weights = model.loss_weights(role) if weights is None else weights.to(device)
    terms = []
    for batch in windows.split(EVALUATION_BATCH):
        batch = batch.to(device)
        predicted, _ = model(role, batch.inputs, batch.maps)
        terms.append(component_losses(predicted, batch.targets, weights))
    return terms


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
    """Predict many steps ahead: each prediction starts where the previous one ends.

    The SIDM keeps its memory from step to step, and the height map is sampled at each
    predicted pose.

    Args:
        model: the trained model.
        heights: (H, W), m; or (B, H, W), one terrain for each robot; None for a body
            without a map.
        state: (S,) or (B, S), the states at the start.
        actions: (K, A) or (B, K, A), for K steps.
        pixels: P of the model's maps.
        role: the system whose encoder and decoder predict.
        spacing: distance between two points of the terrain's grid, m.
        body: what states and actions are made of.
        memory: the model's memory before the start.

    Returns:
        Predicted states (K + 1, S) or (B, K + 1, S), with the given state first, in the
        type of `state`.
    """
    state, actions = torch.as_tensor(state), torch.as_tensor(actions)
    single = state.ndim == 1
    if single:
        state, actions = state[None], actions[None]
    terrains = None if heights is None else torch.as_tensor(heights)
    if single and terrains is not None:
        terrains = terrains[None]
    require_shape(state, ("B", len(body.state)), "state")
    require_shape(actions, (len(state), "K", len(body.actions)), "actions")
    if body.map_size:
        grids = torch.empty(0) if terrains is None else terrains
        require_shape(grids, (len(state), "H", "W"), "heights")
    device, pixels = model.device, body.pixels(pixels)
    states = [state.double()]
    maps = torch.zeros(len(state), 0, 0).half()  # of a body without a map
    with torch.inference_mode():
        for action in actions.double().unbind(1):
            inputs = encode_inputs(states[-1], action, body).float()  # (B, X)
            if terrains is not None and pixels:  # (B, P, P)
                maps = robot_centred_map(
                    terrains, states[-1], pixels, body.map_size, spacing, body
                ).half()
            step = inputs[:, None].to(device), maps[:, None].to(device)  # T is 1
            predicted, memory = model(role, *step, memory)  # (B, 1, Y)
            states.append(integrate(states[-1], predicted[:, 0].cpu().double(), body))
    path = torch.stack(states, dim=1).to(state.dtype).clone()
    return path[0] if single else path


def rollout_errors(
    predicted: Tensor, actual: Tensor, body: Body = ROVER
) -> tuple[Tensor, Tensor]:
    """Errors of predicted paths (..., K + 1, S), with the common start first.

    Distances between positions, m, and absolute differences of headings, rad in
    [0, pi], each (..., K), without the start. The body has a pose.
    """
    require_shape(predicted, ("...", "K + 1", len(body.state)), "predicted")
    require_shape(actual, predicted.shape, "actual")
    predicted, actual = predicted[..., 1:, :].double(), actual[..., 1:, :].double()
    axes = slice(0, 2 if body.pose == "planar" else 3)
    distance = (predicted[..., axes] - actual[..., axes]).norm(dim=-1)
    turn = rotations.wrap(heading_of(predicted, body) - heading_of(actual, body))
    return distance, turn.abs()
