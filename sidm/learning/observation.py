"""From states to what the networks see and predict, and back (section 4 of the paper).

The state vector is the table of `sidm.trajectory`. The input x is 11 numbers and a robot-centred height map; the output
y, a transition, is 13 numbers:

=====  ========================================  ==========  =======================
index  quantity of x                             unit        frame
=====  ========================================  ==========  =======================
0-2    up direction                              -           body
3-8    twist: linear, angular velocity           m/s, rad/s  body
9-10   action: throttle, steering                -           -
=====  ========================================  ==========  =======================

=====  ========================================  ==========  =======================
index  quantity of y                             unit        frame
=====  ========================================  ==========  =======================
0-2    translation                               m           body before the step
3-6    rotation, quaternion x,y,z,w with w >= 0  -           body before the step
7-12   new twist: linear, angular velocity       m/s, rad/s  body after the step
=====  ========================================  ==========  =======================
"""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from sidm import rotations
from sidm.trajectory import ACTION_SIZE, POSITION, QUATERNION, STATE_SIZE, TWIST

INPUT_SIZE = 11
TARGET_SIZE = 13
MAP_SIZE = 5.0  # side of the robot-centred map, m


def require(tensor: Tensor, size: int, name: str) -> None:
    """ValueError unless the last dimension of `tensor` is `size`."""
    if tensor.ndim == 0 or tensor.shape[-1] != size:
        raise ValueError(f"{name} must have shape (..., {size}), not {tuple(tensor.shape)}")


def encode_inputs(states: Tensor, actions: Tensor) -> Tensor:
    """The 11 numbers of x.

    Args:
        states: (..., 13).
        actions: (..., 2), throttle and steering in [-1, 1].

    Returns:
        (..., 11): up direction in the body frame, twist, action.

    Raises:
        ValueError: wrong shapes.
    """
    require(states, STATE_SIZE, "states")
    require(actions, ACTION_SIZE, "actions")
    up = rotations.rotate_inverse(states[..., QUATERNION], states.new_tensor([0.0, 0.0, 1.0]))
    return torch.cat([up, states[..., TWIST], actions], dim=-1)


def transition(states: Tensor, next_states: Tensor) -> Tensor:
    """The output y (..., 13) that leads from `states` to `next_states`, each (..., 13); its quaternion has w >= 0."""
    require(states, STATE_SIZE, "states")
    require(next_states, STATE_SIZE, "next_states")
    before = states[..., QUATERNION]
    translation = rotations.rotate_inverse(before, next_states[..., POSITION] - states[..., POSITION])
    rotation = rotations.multiply(rotations.conjugate(before), next_states[..., QUATERNION])
    return torch.cat([translation, rotations.canonical(rotation), next_states[..., TWIST]], dim=-1)


def integrate(states: Tensor, transitions: Tensor) -> Tensor:
    """The states (..., 13) that `transitions` (..., 13) lead to from `states` (..., 13); quaternions are normalised."""
    require(states, STATE_SIZE, "states")
    require(transitions, TARGET_SIZE, "transitions")
    before = states[..., QUATERNION]
    position = states[..., POSITION] + rotations.rotate(before, transitions[..., POSITION])
    relative = rotations.normalise(transitions[..., QUATERNION])
    quaternion = rotations.normalise(rotations.multiply(before, relative))
    return torch.cat([position, quaternion, transitions[..., TWIST]], dim=-1)


def robot_centred_map(
    heights: Tensor | np.ndarray,
    states: Tensor | np.ndarray,
    pixels: int,
    size: float = MAP_SIZE,
    spacing: float = 0.1,
) -> Tensor:
    """The terrain around the robot, turned with its heading, relative to its own height.

    Args:
        heights: (H, W), m, index [y, x], centred on the world's origin; or (N, H, W), one terrain for each first index
            of `states`. Beyond the grid the height of the border goes on.
        states: (..., 13), or (N, ..., 13) with N terrains.
        pixels: P, a side of the map.
        size: side of the square that the map covers, m.
        spacing: of the terrain's grid, m.

    Returns:
        (..., P, P), m, in the wider of the two types. Axis -2 runs along the body's y (to the left), axis -1 along
        its x (forward), by yaw only; the centre of pixel i is at ((i + 0.5) / P - 0.5) * size.

    Raises:
        ValueError: shapes that do not fit each other.
    """
    heights, states = torch.as_tensor(heights), torch.as_tensor(states)
    several = heights.ndim == 3
    if heights.ndim not in (2, 3) or states.ndim < 1 + several or states.shape[-1] != STATE_SIZE:
        raise ValueError(
            "heights (H, W) with states (..., 13), or heights (N, H, W) with states (N, ..., 13), "
            f"not heights {tuple(heights.shape)} with states {tuple(states.shape)}"
        )
    if several and heights.shape[0] != states.shape[0]:
        raise ValueError(
            f"as many terrains as first indices of states, not heights {tuple(heights.shape)} "
            f"with states {tuple(states.shape)}"
        )
    dtype = torch.promote_types(heights.dtype, states.dtype)
    heights, states = heights.to(dtype), states.to(dtype)
    x, y = _pixel_positions(states, pixels, size)  # each (..., P, P), world
    if several:
        flat = (heights.shape[0], -1)
        ground = surface(heights, x.reshape(flat), y.reshape(flat), spacing).reshape(x.shape)
    else:
        ground = surface(heights[None], x.reshape(1, -1), y.reshape(1, -1), spacing).reshape(x.shape)
    return ground - states[..., 2, None, None]


def _pixel_positions(states: Tensor, pixels: int, size: float) -> tuple[Tensor, Tensor]:
    """World x and y, each (..., P, P), m, of the pixels of maps centred on `states` (..., 13)."""
    offset = ((torch.arange(pixels, dtype=states.dtype, device=states.device) + 0.5) / pixels - 0.5) * size
    forward, left = offset[None, :], offset[:, None]
    heading = rotations.yaw(states[..., QUATERNION])[..., None, None]
    cos, sin = torch.cos(heading), torch.sin(heading)
    x = states[..., 0, None, None] + cos * forward - sin * left
    y = states[..., 1, None, None] + sin * forward + cos * left
    return x, y


def surface(heights: Tensor, x: Tensor, y: Tensor, spacing: float = 0.1) -> Tensor:
    """Heights (N, K), m, of N terrains (N, H, W) at points `x`, `y` (N, K): `sidm.terrain.height_at` on tensors.

    The surface is that of two triangles a grid cell, cut from corner (0, 1) to corner (1, 0).
    """
    rows, columns = heights.shape[-2:]
    across = (x / spacing + (columns - 1) / 2).clamp(0, columns - 1)
    along = (y / spacing + (rows - 1) / 2).clamp(0, rows - 1)
    j = across.floor().clamp(max=columns - 2)
    i = along.floor().clamp(max=rows - 2)
    u, v = across - j, along - i
    corner = (i * columns + j).long()  # (N, K), of the flattened grid
    flat = heights.flatten(1)
    near, far = flat.gather(1, corner), flat.gather(1, corner + columns + 1)
    east, north = flat.gather(1, corner + 1), flat.gather(1, corner + columns)
    lower = near + u * (east - near) + v * (north - near)
    upper = far + (1 - u) * (north - far) + (1 - v) * (east - far)
    return torch.where(u + v <= 1, lower, upper)
