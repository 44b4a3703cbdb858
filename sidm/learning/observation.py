"""From states to what the networks see and predict, and back (section 4 of the paper).

A body (`sidm.body`) says what states, inputs and outputs are made of. The paper's state
is the table of `sidm.drives`; its input x is 11 numbers and a robot-centred height map,
its output y, a transition, is 13 numbers:

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

from collections.abc import Sequence

import numpy as np
import torch
from torch import Tensor

from sidm import rotations
from sidm.body import ROVER, Body
from sidm.drives import POSITION, QUATERNION

#: size of y of the paper's body: 13
TARGET_SIZE = len(ROVER.targets)


def encode_inputs(states: Tensor, actions: Tensor, body: Body = ROVER) -> Tensor:
    """The numbers (..., X) of x without the map, of states (..., S), actions (..., A).

    For the paper's body X is 11, S 13 and A 2: throttle and steering in [-1, 1].
    """
    require_shape(states, ("...", len(body.state)), "states")
    require_shape(actions, ("...", len(body.actions)), "actions")
    up = [_up_direction(states)] if body.tilt else []
    return torch.cat([*up, states[..., body.pose_size :], actions], dim=-1)


def transition(states: Tensor, next_states: Tensor, body: Body = ROVER) -> Tensor:
    """The output y (..., Y), raw units: from states (..., S) to the next ones."""
    require_shape(states, ("...", len(body.state)), "states")
    require_shape(next_states, ("...", len(body.state)), "next_states")
    columns = next_states[..., body.pose_size :]
    if body.pose == "none":
        return columns
    change = next_states[..., :3] - states[..., :3]
    if body.pose == "planar":
        translation = rotations.turn(change[..., :2], -states[..., 2])
        yaw = rotations.wrap(change[..., 2:])
        return torch.cat([translation, yaw, columns], dim=-1)
    before = states[..., QUATERNION]
    translation = rotations.rotate_inverse(before, change)
    inverse = rotations.conjugate(before)
    rotation = rotations.multiply(inverse, next_states[..., QUATERNION])
    return torch.cat([translation, rotations.canonical(rotation), columns], dim=-1)


def integrate(states: Tensor, transitions: Tensor, body: Body = ROVER) -> Tensor:
    """The states (..., S) that transitions (..., Y) lead to; unit quaternions."""
    require_shape(states, ("...", len(body.state)), "states")
    require_shape(transitions, ("...", len(body.targets)), "transitions")
    columns = transitions[..., body.pose_size :]
    if body.pose == "none":
        return columns
    if body.pose == "planar":
        translation = rotations.turn(transitions[..., :2], states[..., 2])
        yaw = rotations.wrap(states[..., 2:3] + transitions[..., 2:3])
        return torch.cat([states[..., :2] + translation, yaw, columns], dim=-1)
    before = states[..., QUATERNION]
    translation = rotations.rotate(before, transitions[..., POSITION])
    rotation = rotations.normalise(transitions[..., QUATERNION])
    quaternion = rotations.normalise(rotations.multiply(before, rotation))
    position = states[..., POSITION] + translation
    return torch.cat([position, quaternion, columns], dim=-1)


def robot_centred_map(
    heights: Tensor | np.ndarray,
    states: Tensor | np.ndarray,
    pixels: int,
    size: float = ROVER.map_size,
    spacing: float = 0.1,
    body: Body = ROVER,
) -> Tensor:
    """Heights of the ground around the robot, relative to the robot's own height.

    The map turns with the robot's yaw but not with its tilt.

    Args:
        heights: (H, W), m, index [y, x], centred on the world's origin; or (N, H, W),
            one terrain for each first index of `states`. The heights of the border
            continue beyond the grid.
        states: (..., S), or (N, ..., S) with N terrains; S is 13 for the paper's body.
        pixels: P, number of pixels along a side of the map.
        size: side of the square that the map covers, m.
        spacing: distance between two points of the terrain's grid, m.
        body: says what a state is made of. A planar pose has no height; the height of
            the ground under the robot takes its place.

    Returns:
        Maps (..., P, P), m, in the wider of the two types. Axis -2 runs along the
        body's y (to the left), axis -1 along its x (forward); the centre of pixel i is
        at ((i + 0.5) / P - 0.5) * size.
    """
    heights, states = torch.as_tensor(heights), torch.as_tensor(states)
    require_shape(states, ("...", len(body.state)), "states")
    several = (len(states),) if heights.ndim == 3 else ()
    require_shape(heights, (*several, "H", "W"), "heights")
    dtype = torch.promote_types(heights.dtype, states.dtype)
    heights, states = heights.to(dtype), states.to(dtype)
    indices = torch.arange(pixels, dtype=states.dtype, device=states.device)
    offset = ((indices + 0.5) / pixels - 0.5) * size
    forward, left = offset[None, :], offset[:, None]
    heading = heading_of(states, body)[..., None, None]
    cos, sin = torch.cos(heading), torch.sin(heading)
    # (..., P, P) each, world frame
    x = states[..., 0, None, None] + cos * forward - sin * left
    y = states[..., 1, None, None] + sin * forward + cos * left
    if body.pose == "spatial":
        robot_height = states[..., 2]
    else:
        robot_height = _ground(heights, states[..., 0], states[..., 1], spacing)
    return _ground(heights, x, y, spacing) - robot_height[..., None, None]


def heading_of(states: Tensor, body: Body = ROVER) -> Tensor:
    """Yaw (...), rad, of states (..., S) with a pose."""
    if body.pose == "spatial":
        return rotations.yaw(states[..., QUATERNION])
    return states[..., 2]


def surface(heights: Tensor, x: Tensor, y: Tensor, spacing: float = 0.1) -> Tensor:
    """Heights (N, K), m, of N terrains (N, H, W) at points x and y (N, K) each, m.

    It is `sidm.terrain.height_at` for tensors: two triangles in each grid cell, which
    is cut from corner (0, 1) to corner (1, 0).
    """
    rows, columns = heights.shape[-2:]
    across = (x / spacing + (columns - 1) / 2).clamp(0, columns - 1)
    along = (y / spacing + (rows - 1) / 2).clamp(0, rows - 1)
    j = across.floor().clamp(max=columns - 2)
    i = along.floor().clamp(max=rows - 2)
    u, v = across - j, along - i
    corner = i.long() * columns + j.long()  # (N, K), index into the flattened grid
    flat = heights.flatten(1)
    near, far = flat.gather(1, corner), flat.gather(1, corner + columns + 1)
    east, north = flat.gather(1, corner + 1), flat.gather(1, corner + columns)
    lower = near + u * (east - near) + v * (north - near)
    upper = far + (1 - u) * (north - far) + (1 - v) * (east - far)
    return torch.where(u + v <= 1, lower, upper)


def _ground(heights: Tensor, x: Tensor, y: Tensor, spacing: float) -> Tensor:
    """Heights of (N, H, W) or (H, W) at `x`, `y`, (N, ...) or (...), in their shape."""
    grids = heights if heights.ndim == 3 else heights[None]
    points = x.reshape(len(grids), -1), y.reshape(len(grids), -1)
    return surface(grids, *points, spacing).reshape(x.shape)


def _up_direction(states: Tensor) -> Tensor:
    """The up direction (..., 3) in the body's frame, for states with a spatial pose."""
    up = states.new_tensor([0.0, 0.0, 1.0])
    return rotations.rotate_inverse(states[..., QUATERNION], up)


def require_shape(tensor: Tensor, shape: Sequence[int | str], name: str) -> None:
    """Raise a ValueError unless `tensor` has a shape; letters are any lengths.

    A shape that begins with '...' is that of the last dimensions.
    """
    found, wanted = tuple(tensor.shape), tuple(shape)
    if wanted[0] == "...":
        found, wanted = found[1 - len(wanted) :], wanted[1:]
    if len(found) != len(wanted) or any(
        isinstance(size, int) and size != length
        for length, size in zip(found, wanted, strict=True)
    ):
        expected = ", ".join(map(str, shape))
        raise ValueError(
            f"{name} must have shape ({expected}), not {tuple(tensor.shape)}"
        )
