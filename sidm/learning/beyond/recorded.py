"""Recordings from elsewhere as the networks see them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from sidm.learning.dataset import Motion
from sidm.learning.observation import encode_inputs, robot_centred_map, transition
from sidm.recordings import Recording
from sidm.trajectory import STEPS, checksum


class Pieces(NamedTuple):
    """N trajectories of STEPS steps, cut one after the other from recordings, less what is left over at an end."""

    states: Tensor  # (N, T + 1, 13) float64
    actions: Tensor  # (N, T, 2) float64
    ground: Tensor  # (N,) which of `grounds` each drove on
    grounds: list[Tensor]  # heights (H, W), m, of each; about the origin
    spacing: list[float]  # m, of each


def cut(recordings: Sequence[Recording]) -> Pieces:
    """The pieces of recordings, in their order; grounds that are equal are one.

    Raises:
        ValueError: no recordings.
    """
    if not recordings:
        raise ValueError("at least one recording is needed, not none")
    states, actions, which = [], [], []
    grounds: dict[tuple[str, float], int] = {}
    heights, spacing = [], []
    for one in recordings:
        key = checksum(one.ground.heights), one.ground.spacing
        if key not in grounds:
            grounds[key] = len(grounds)
            heights.append(torch.from_numpy(one.ground.heights))
            spacing.append(one.ground.spacing)
        for start in range(0, one.pieces * STEPS, STEPS):
            states.append(one.states[start : start + STEPS + 1])
            actions.append(one.actions[start : start + STEPS])
            which.append(grounds[key])
    paths, driven = (torch.from_numpy(np.stack(some)) for some in (states, actions))
    return Pieces(paths, driven, torch.tensor(which), heights, spacing)


def recorded_motion(pieces: Pieces, pixels: int) -> Motion:
    """Pieces as tensors, with maps of `pixels` a side; as `dataset.prepare` makes them of simulated trajectories."""
    maps = torch.stack([
        robot_centred_map(pieces.grounds[ground], states[:-1], pixels, spacing=pieces.spacing[ground]).half()
        for ground, states in zip(pieces.ground.tolist(), pieces.states, strict=True)
    ])  # fmt: skip
    before, after = pieces.states[:, :-1], pieces.states[:, 1:]
    return Motion(encode_inputs(before, pieces.actions).float(), transition(before, after).float(), maps)


def apart(pieces: Pieces, share: float) -> tuple[Tensor, Tensor, bool]:
    """Numbers (n,) of the pieces to learn from and (m,) of those to judge by, and whether their grounds differ.

    Those to judge by are on the last grounds, a `share` of them and at least one; with a single ground they are the
    last pieces. Two maps of one place that differ anywhere are two grounds here.

    Raises:
        ValueError: a share that leaves nothing on one side.
    """
    grounds, count = len(pieces.grounds), len(pieces.states)
    if not 0 < share < 1 or count < 2:
        raise ValueError(f"a share above 0 and below 1 of at least 2 pieces, not {share:g} of {count}")
    if grounds > 1:
        return *apart_by_ground(pieces, min(max(1, round(share * grounds)), grounds - 1)), True
    last = min(max(1, round(share * count)), count - 1)
    numbers = torch.arange(count)
    return numbers[:-last], numbers[-last:], False


def apart_by_ground(pieces: Pieces, held_out: int) -> tuple[Tensor, Tensor]:
    """Numbers (n,) of the pieces to learn from and (m,) of those to judge by: those on the last `held_out` grounds.

    Raises:
        ValueError: as many grounds or more are to be held out as there are.
    """
    if not 0 < held_out < len(pieces.grounds):
        raise ValueError(f"from 1 to {len(pieces.grounds) - 1} of {len(pieces.grounds)} grounds, not {held_out}")
    judging = pieces.ground >= len(pieces.grounds) - held_out
    return torch.nonzero(~judging).flatten(), torch.nonzero(judging).flatten()
