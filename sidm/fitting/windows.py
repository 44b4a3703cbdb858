"""Recorded drives as what the networks learn from: pieces of equal length, with maps of the ground they drove on."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from sidm.body import ROVER, Body
from sidm.config import ConfigError
from sidm.learning.dataset import TEST_EVERY, Motion, motion_of
from sidm.learning.evaluation import rollout
from sidm.learning.model import Predictor
from sidm.learning.observation import robot_centred_map
from sidm.recordings import Drive
from sidm.trajectory import STEPS, checksum


class Pieces(NamedTuple):
    """N pieces of T steps each, cut one after the other from drives."""

    states: Tensor  # (N, T + 1, S) float64
    actions: Tensor  # (N, T, A) float64
    sessions: np.ndarray  # (N,) text: those of one belong together
    body: Body
    ground: Tensor  # (N,) which of `grounds` each drove on; 0 of a body without a height map
    grounds: list[Tensor]  # heights (H, W), m, of each; about the origin; none of such a body
    spacing: list[float]  # m, of each

    @property
    def minutes(self) -> float:
        """Of motion."""
        return self.actions.shape[0] * self.actions.shape[1] / self.body.rate / 60

    def motion(self, pixels: int = 0) -> Motion:
        """As the networks see them, with maps of `pixels` a side where the body does not say how many."""
        body, maps = self.body, None
        if body.map_size:
            maps = torch.stack([
                robot_centred_map(
                    self.grounds[ground], states[:-1], body.pixels(pixels), body.map_size, self.spacing[ground], body
                ).half()
                for ground, states in zip(self.ground.tolist(), self.states, strict=True)
            ])  # fmt: skip
        return motion_of(body, self.states, self.actions, maps)

    def take(self, chosen: np.ndarray | Tensor) -> Pieces:
        """Those that are chosen, by number or by truth."""
        numbers = torch.arange(len(self.states))[torch.as_tensor(chosen)]
        return self._replace(
            states=self.states[numbers], actions=self.actions[numbers], sessions=self.sessions[numbers.numpy()],
            ground=self.ground[numbers],
        )  # fmt: skip

    def of_sessions(self, sessions: Sequence[str] | np.ndarray) -> Pieces:
        """The pieces of some sessions."""
        return self.take(np.isin(self.sessions, sessions))

    def begun(self, steps: int) -> Pieces:
        """Their first steps."""
        return self._replace(states=self.states[:, : steps + 1], actions=self.actions[:, :steps])

    def rollout(self, model: Predictor, start: int, steps: int, pixels: int = 0, seen: bool = True) -> Tensor:
        """States (N, K + 1, S) that a model predicts open loop for K steps from step `start` of each piece on.

        It has `seen` the steps before, or begins there from the same state.
        """
        path = self.states[:, start : start + steps + 1].clone()
        for ground in self.ground.unique().tolist():
            numbers = torch.nonzero(self.ground == ground).flatten()
            some, memory = self.take(numbers), None
            if seen and start:
                motion = some.begun(start).motion(pixels)
                with torch.inference_mode():
                    _, memory = model("novice", motion.inputs, motion.maps)
            heights, spacing = None, 0.0
            if self.grounds:
                heights, spacing = self.grounds[ground].expand(len(numbers), -1, -1), self.spacing[ground]
            states, actions = some.states[:, start], some.actions[:, start : start + steps]
            path[numbers] = rollout(
                model, heights, states, actions, pixels, spacing=spacing, body=self.body, memory=memory
            )
        return path


def common_length(*robots: Sequence[Drive]) -> int:
    """Steps T of a piece, the same for all that learn together: those of the shortest drive, at most the paper's 64."""
    return min(STEPS, *(len(drive.actions) for drives in robots for drive in drives))


def cut(drives: Sequence[Drive], body: Body = ROVER, steps: int = STEPS) -> Pieces:
    """Pieces of `steps` from the beginning of each drive on, less what is left over at its end; equal grounds are one.

    Raises:
        ConfigError: no drive is as long, or grounds lack.
    """
    states, actions, sessions, which = [], [], [], []
    grounds: dict[str, int] = {}
    heights, spacing = [], []
    for one in drives:
        if body.map_size:
            if one.ground is None:
                raise ConfigError(f"{one.name}: body '{body.name}' sees a height map, and the drive has no ground")
            key = f"{checksum(one.ground.heights)} {one.ground.spacing}"
            if key not in grounds:
                grounds[key] = len(grounds)
                heights.append(torch.from_numpy(one.ground.heights))
                spacing.append(one.ground.spacing)
        for first in range(0, len(one.actions) - steps + 1, steps):
            states.append(one.states[first : first + steps + 1])
            actions.append(one.actions[first : first + steps])
            sessions.append(one.session)
            which.append(grounds[key] if body.map_size else 0)
    if not states:
        raise ConfigError(f"no drive has {steps} steps of {1 / body.rate:g} s; record longer ones")
    paths, driven = (torch.from_numpy(np.stack(some)) for some in (states, actions))
    return Pieces(paths, driven, np.array(sessions), body, torch.tensor(which), heights, spacing)


def session_order(pieces: Pieces, seed: int) -> np.ndarray:
    """The names of all sessions in a random order."""
    return np.random.default_rng(seed).permutation(np.unique(pieces.sessions))


def learn_and_test(pieces: Pieces, sessions: np.ndarray) -> tuple[Pieces, Pieces]:
    """Pieces to learn from and pieces to stop by: of four sessions one tests; of a single one every fourth piece.

    Raises:
        ConfigError: too few pieces for both.
    """
    mine = pieces.of_sessions(sessions)
    order = {name: number for number, name in enumerate(sessions)}
    number = np.array([order[name] for name in mine.sessions]) if len(sessions) > 1 else np.arange(len(mine.sessions))
    testing = number % TEST_EVERY == 1
    if not testing.any() or testing.all():
        raise ConfigError(f"{len(mine.sessions)} pieces of {len(sessions)} sessions are too few to learn and to test")
    return mine.take(~testing), mine.take(testing)


def apart_by_ground(pieces: Pieces, held_out: int) -> tuple[Tensor, Tensor]:
    """Numbers (n,) of the pieces to learn from and (m,) of those to judge by: those on the last `held_out` grounds.

    Raises:
        ValueError: as many grounds or more are to be held out as there are.
    """
    if not 0 < held_out < len(pieces.grounds):
        raise ValueError(f"from 1 to {len(pieces.grounds) - 1} of {len(pieces.grounds)} grounds, not {held_out}")
    judging = pieces.ground >= len(pieces.grounds) - held_out
    return torch.nonzero(~judging).flatten(), torch.nonzero(judging).flatten()
