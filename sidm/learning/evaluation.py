"""How good a model is: the validation loss by component, and rollouts of many steps (section 5, Figure 4)."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from sidm import rotations
from sidm.learning.dataset import Motion, Part
from sidm.learning.losses import component_losses, prediction_loss
from sidm.learning.model import Predictor
from sidm.learning.observation import TARGET_SIZE, encode_inputs, integrate, robot_centred_map
from sidm.trajectory import ACTION_SIZE, POSITION, QUATERNION, STATE_SIZE

EVALUATION_BATCH = 32  # trajectories at a time where no gradient is needed


def mean_loss(model: Predictor, motion: Motion | Part, role: str = "novice") -> float:
    """Equation (1) averaged over the steps of `motion`."""
    total = 0.0
    with torch.inference_mode():
        for part in motion.split(EVALUATION_BATCH):
            part = part.to(model.device)
            total += float(prediction_loss(model(role, part.inputs, part.maps)[0], part.targets).double().sum())
    return total / motion.targets[..., 0].numel()


def validation_loss(model: Predictor, motion: Motion | Part, role: str = "novice") -> Tensor:
    """Mean over all steps of `motion` of each term of equation (1): (13,) float64, raw units; their sum is the loss."""
    total = torch.zeros(TARGET_SIZE, dtype=torch.float64)
    with torch.inference_mode():
        for part in motion.split(EVALUATION_BATCH):
            part = part.to(model.device)
            predicted, _ = model(role, part.inputs, part.maps)
            total += component_losses(predicted, part.targets).double().sum((0, 1)).cpu()
    return total / motion.targets[..., 0].numel()


def rollout(
    model: Predictor,
    heights: Tensor | np.ndarray,
    state: Tensor,
    actions: Tensor,
    pixels: int,
    role: str = "novice",
    spacing: float = 0.1,
) -> Tensor:
    """Predict many steps ahead: each prediction is integrated and the next one starts from there.

    The SIDM's memory is carried along, and the height map is sampled at each predicted pose.

    Args:
        model: the trained model.
        heights: (H, W), m; or (B, H, W), a terrain each.
        state: (13,), or (B, 13): where the robots start.
        actions: (K, 2), or (B, K, 2).
        pixels: P of the model's maps.
        role: whose encoder and decoder.
        spacing: of the terrain's grid, m.

    Returns:
        Predicted states (K + 1, 13), or (B, K + 1, 13), the given one first, in the type of `state`.

    Raises:
        ValueError: shapes that do not fit each other.
    """
    state, actions = torch.as_tensor(state), torch.as_tensor(actions)
    heights = torch.as_tensor(heights)
    single = state.ndim == 1
    if single:
        heights, state, actions = heights[None], state[None], actions[None]
    if (
        heights.ndim != 3 or state.shape != (len(heights), STATE_SIZE) or actions.ndim != 3
        or (len(actions), actions.shape[-1]) != (len(heights), ACTION_SIZE)
    ):  # fmt: skip
        raise ValueError(
            "heights (B, H, W), state (B, 13) and actions (B, K, 2) of one B, not "
            f"{tuple(heights.shape)}, {tuple(state.shape)} and {tuple(actions.shape)}"
        )
    states, memory = [state.double()], None
    with torch.inference_mode():
        for action in actions.double().unbind(1):
            inputs = encode_inputs(states[-1], action).float()[:, None]  # (B, 1, 11)
            maps = robot_centred_map(heights, states[-1], pixels, spacing=spacing).half()[:, None]  # (B, 1, P, P)
            predicted, memory = model(role, inputs.to(model.device), maps.to(model.device), memory)
            states.append(integrate(states[-1], predicted[:, 0].cpu().double()))
    path = torch.stack(states, dim=1).to(state.dtype).clone()
    return path[0] if single else path


def rollout_errors(predicted: Tensor, actual: Tensor) -> tuple[Tensor, Tensor]:
    """How far predicted paths stray from the actual ones, step by step.

    Args:
        predicted: states (..., K + 1, 13), the common start first.
        actual: the same shape.

    Returns:
        Distance between positions, m, and absolute difference of headings, rad in [0, pi], each (..., K): without the
        start.

    Raises:
        ValueError: the shapes differ or are not of states.
    """
    if predicted.shape != actual.shape or predicted.ndim < 2 or predicted.shape[-1] != STATE_SIZE:
        raise ValueError(
            f"predicted and actual states (..., K + 1, 13), not {tuple(predicted.shape)} and {tuple(actual.shape)}"
        )
    predicted, actual = predicted[..., 1:, :].double(), actual[..., 1:, :].double()
    position = (predicted[..., POSITION] - actual[..., POSITION]).norm(dim=-1)
    turn = rotations.yaw(predicted[..., QUATERNION]) - rotations.yaw(actual[..., QUATERNION])
    return position, rotations.wrap(turn).abs()
