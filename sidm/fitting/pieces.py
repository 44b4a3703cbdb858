"""Recorded drives as what the networks learn from: pieces of equal length, never parted within a session."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import torch

from sidm.body import Body
from sidm.config import ConfigError
from sidm.learning.dataset import TEST_EVERY, Motion, motion_of
from sidm.recordings.drives import Drive
from sidm.trajectory import STEPS


class Pieces(NamedTuple):
    """N pieces of T steps each, and what they were cut from."""

    states: torch.Tensor  # (N, T + 1, S) float64
    actions: torch.Tensor  # (N, T, A) float64
    sessions: np.ndarray  # (N,) text
    body: Body

    @property
    def minutes(self) -> float:
        """Of motion."""
        return self.actions.shape[0] * self.actions.shape[1] / self.body.rate / 60

    def motion(self) -> Motion:
        """As the networks see them."""
        return motion_of(self.body, self.states, self.actions)

    def take(self, chosen: np.ndarray) -> Pieces:
        """Those that are chosen, by number or by truth."""
        numbers = torch.from_numpy(np.arange(len(self.sessions))[chosen])
        return Pieces(self.states[numbers], self.actions[numbers], self.sessions[numbers.numpy()], self.body)

    def of_sessions(self, sessions: Sequence[str] | np.ndarray) -> Pieces:
        """The pieces of some sessions."""
        return self.take(np.isin(self.sessions, sessions))


def common_length(*robots: Sequence[Drive]) -> int:
    """Steps T of a piece, the same for all that learn together: those of the shortest drive, at most the paper's 64."""
    return min(STEPS, *(len(drive.actions) for drives in robots for drive in drives))


def cut(drives: Sequence[Drive], body: Body, steps: int) -> Pieces:
    """Pieces of `steps` from the beginning of each drive on; what is left over at its end is not used."""
    states, actions, sessions = [], [], []
    for drive in drives:
        for first in range(0, len(drive.actions) - steps + 1, steps):
            states.append(drive.states[first : first + steps + 1])
            actions.append(drive.actions[first : first + steps])
            sessions.append(drive.session)
    if not states:
        raise ConfigError(f"no drive has {steps} steps of {1 / body.rate:g} s; record longer ones")
    return Pieces(torch.from_numpy(np.stack(states)), torch.from_numpy(np.stack(actions)), np.array(sessions), body)


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
