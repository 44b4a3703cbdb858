"""From states to what the networks see and predict, and back (section 4 of the paper).

What they are made of is a body's (`sidm.body`). The paper's state is the table of
`sidm.drives`; its input x is 11 numbers and a robot-centred height map, its output y, a
transition, 13 numbers:

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
from sidm.body import ROVER, UP, Body
from sidm.config import unknown_name
from sidm.drives import ACTION_SIZE, POSITION, QUATERNION, STATE_SIZE, TWIST

#: 11 and 13, of the paper
INPUT_SIZE, TARGET_SIZE = len(ROVER.inputs), len(ROVER.targets)


def require(tensor: Tensor, size: int, name: str) -> None:
    """ValueError unless the last dimension of `tensor` is `size`."""
    if tensor.ndim == 0 or tensor.shape[-1] != size:
        raise ValueError(
            f"{name} must have shape (..., {size}), not {tuple(tensor.shape)}"
        )


def encode_inputs(states: Tensor, actions: Tensor, body: Body = ROVER) -> Tensor:
    """The numbers of x.

    Args:
        states: (..., S), the paper's (..., 13).
        actions: (..., A), the paper's (..., 2): throttle and steering in [-1, 1].
        body: what they are made of.

    Returns:
        (..., X), the paper's (..., 11): up direction in the body frame, twist, action.

    Raises:
        ValueError: wrong shapes.
    """
    require(states, len(body.state), "states")
    require(actions, len(body.actions), "actions")
    up = [_up(states)] if body.tilt else []
    return torch.cat([*up, states[..., body.pose_size :], actions], dim=-1)


def _up(states: Tensor) -> Tensor:
    """The up direction (..., 3) in the body's frame, of states whose pose is spatial."""
    return rotations.rotate_inverse(
        states[..., QUATERNION], states.new_tensor([0.0, 0.0, 1.0])
    )


def transition(states: Tensor, next_states: Tensor, body: Body = ROVER) -> Tensor:
    """The output y (..., Y) that leads from `states` to `next_states`, each (..., S); a quaternion has w >= 0."""
    require(states, len(body.state), "states")
    require(next_states, len(body.state), "next_states")
    new, way = (
        next_states[..., body.pose_size :],
        next_states[..., :3] - states[..., :3],
    )
    if body.pose == "none":
        return new
    if body.pose == "planar":
        turn = rotations.wrap(way[..., 2:])
        return torch.cat(
            [rotations.turn(way[..., :2], -states[..., 2]), turn, new], dim=-1
        )
    before = states[..., QUATERNION]
    rotation = rotations.multiply(
        rotations.conjugate(before), next_states[..., QUATERNION]
    )
    return torch.cat(
        [rotations.rotate_inverse(before, way), rotations.canonical(rotation), new],
        dim=-1,
    )


def integrate(states: Tensor, transitions: Tensor, body: Body = ROVER) -> Tensor:
    """The states (..., S) that `transitions` (..., Y) lead to from `states` (..., S); quaternions are normalised."""
    require(states, len(body.state), "states")
    require(transitions, len(body.targets), "transitions")
    new = transitions[..., body.pose_size :]
    if body.pose == "none":
        return new
    if body.pose == "planar":
        place = states[..., :2] + rotations.turn(transitions[..., :2], states[..., 2])
        return torch.cat(
            [place, rotations.wrap(states[..., 2:3] + transitions[..., 2:3]), new],
            dim=-1,
        )
    before = states[..., QUATERNION]
    position = states[..., POSITION] + rotations.rotate(
        before, transitions[..., POSITION]
    )
    relative = rotations.normalise(transitions[..., QUATERNION])
    quaternion = rotations.normalise(rotations.multiply(before, relative))
    return torch.cat([position, quaternion, new], dim=-1)


def seen_as(body: Body, states: Tensor, actions: Tensor) -> tuple[Tensor, Tensor]:
    """The paper's states (..., 13) and actions (..., 2) as a robot of another body has them.

    Returns:
        States (..., S) and actions (..., A): the pose of the body's kind; of columns
        those of the paper's state and of the up direction, `up_x` to `up_z`; of actions
        throttle and steering, or `left` and `right`, their sum and their difference.

    Raises:
        ConfigError: a column that the paper's robots do not have.
    """
    require(states, STATE_SIZE, "states")
    require(actions, ACTION_SIZE, "actions")
    known = dict(
        zip(
            (name for name, _ in ROVER.columns),
            states[..., TWIST].unbind(-1),
            strict=True,
        )
    )
    known |= dict(
        zip(
            (name.replace(" ", "_") for name in UP), _up(states).unbind(-1), strict=True
        )
    )
    throttle, steering = actions.unbind(-1)
    commands = {
        "throttle": throttle,
        "steering": steering,
        "left": throttle + steering,
        "right": throttle - steering,
    }

    def chosen(
        columns: tuple[tuple[str, str], ...], some: dict[str, Tensor], like: Tensor
    ) -> Tensor:
        for name, _ in columns:
            if name not in some:
                raise unknown_name(
                    name, some, f"what the paper's robots have for body '{body.name}'"
                )
        return (
            torch.stack([some[name] for name, _ in columns], -1)
            if columns
            else like[..., :0]
        )

    pose = {
        "none": lambda: states[..., :0],
        "planar": lambda: torch.cat(
            [states[..., :2], rotations.yaw(states[..., QUATERNION])[..., None]], -1
        ),
        "spatial": lambda: states[..., : QUATERNION.stop],
    }[body.pose]()
    return torch.cat([pose, chosen(body.columns, known, states)], -1), chosen(
        body.actions, commands, actions
    )


def robot_centred_map(
    heights: Tensor | np.ndarray,
    states: Tensor | np.ndarray,
    pixels: int,
    size: float = ROVER.map_size,
    spacing: float = 0.1,
    body: Body = ROVER,
) -> Tensor:
    """The terrain around the robot, turned with its heading, relative to its own height.

    Args:
        heights: (H, W), m, index [y, x], centred on the world's origin; or (N, H, W),
            one terrain for each first index of `states`. Beyond the grid the height of
            the border goes on.
        states: (..., S), or (N, ..., S) with N terrains; the paper's S is 13.
        pixels: P, a side of the map.
        size: side of the square that the map covers, m.
        spacing: of the terrain's grid, m.
        body: what a state is made of; a planar pose has no height, the ground's under
            it stands for it.

    Returns:
        (..., P, P), m, in the wider of the two types. Axis -2 runs along the body's y
        (to the left), axis -1 along its x (forward), by yaw only; the centre of pixel i
        is at ((i + 0.5) / P - 0.5) * size.

    Raises:
        ValueError: shapes that do not fit each other.
    """
    heights, states = torch.as_tensor(heights), torch.as_tensor(states)
    several, count = heights.ndim == 3, len(body.state)
    fit = (
        heights.ndim in (2, 3)
        and states.ndim >= 1 + several
        and states.shape[-1] == count
    )
    if not fit or (several and len(heights) != len(states)):
        raise ValueError(
            f"heights (H, W) with states (..., {count}), or heights (N, H, W) with states (N, ..., {count}) of one N, "
            f"not heights {tuple(heights.shape)} with states {tuple(states.shape)}"
        )
    dtype = torch.promote_types(heights.dtype, states.dtype)
    heights, states = (
        (heights if several else heights[None]).to(dtype),
        states.to(dtype),
    )
    x, y = _pixel_positions(states, pixels, size, body)  # each (..., P, P), world
    own = (
        states[..., 2]
        if body.pose == "spatial"
        else _ground(heights, states[..., 0], states[..., 1], spacing)
    )
    return _ground(heights, x, y, spacing) - own[..., None, None]


def _ground(heights: Tensor, x: Tensor, y: Tensor, spacing: float) -> Tensor:
    """Heights (N, ...) of N terrains (N, H, W) at `x`, `y` (N, ...); or (...) of one terrain (1, H, W)."""
    flat = (len(heights), -1)
    return surface(heights, x.reshape(flat), y.reshape(flat), spacing).reshape(x.shape)


def _pixel_positions(
    states: Tensor, pixels: int, size: float, body: Body
) -> tuple[Tensor, Tensor]:
    """World x and y, each (..., P, P), m, of the pixels of maps centred on `states` (..., S)."""
    offset = (
        (torch.arange(pixels, dtype=states.dtype, device=states.device) + 0.5) / pixels
        - 0.5
    ) * size
    forward, left = offset[None, :], offset[:, None]
    heading = heading_of(states, body)[..., None, None]
    cos, sin = torch.cos(heading), torch.sin(heading)
    x = states[..., 0, None, None] + cos * forward - sin * left
    y = states[..., 1, None, None] + sin * forward + cos * left
    return x, y


def heading_of(states: Tensor, body: Body = ROVER) -> Tensor:
    """Yaw (...), rad, of states (..., S) with a pose."""
    return (
        rotations.yaw(states[..., QUATERNION])
        if body.pose == "spatial"
        else states[..., 2]
    )


def surface(heights: Tensor, x: Tensor, y: Tensor, spacing: float = 0.1) -> Tensor:
    """Heights (N, K), m, of N terrains (N, H, W) at points `x`, `y` (N, K): `sidm.terrain.height_at` on tensors.

    The surface is that of two triangles a grid cell, cut from corner (0, 1) to corner
    (1, 0).
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
