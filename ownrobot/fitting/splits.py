"""Splits of drives: what a model learns from, what stops it and what evaluates it.

Drives of one session are alike, so a session is never divided.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ownrobot.fitting.windows import common_length, part_of
from sidm.config import ConfigError, counted
from sidm.drives import Drive
from sidm.shards import TEST_EVERY

MIN_GROUPS = 8  # sessions, or drives of a single one, from which some are held out
FOLDS = 4  # parts in which fewer are held out, one after the other
MIN_WINDOWS = 2 * TEST_EVERY  # windows to learn from and to stop by, at least


class Split(NamedTuple):
    """Drives to learn from, and drives of other sessions to evaluate on."""

    learn: list[Drive]
    held_out: list[Drive]


def sessions_of(drives: Sequence[Drive]) -> np.ndarray:
    """(N,) text, the session of each drive."""
    return np.array([drive.session for drive in drives])


def groups_of(drives: Sequence[Drive]) -> np.ndarray:
    """(N,) text, the group of each drive that no split divides.

    A group is a session; in a single session each drive is a group.
    """
    sessions = sessions_of(drives)
    if len(np.unique(sessions)) > 1:
        return sessions
    return np.arange(len(drives)).astype(str)


def drives_of_sessions(
    drives: Sequence[Drive], sessions: Sequence[str] | np.ndarray
) -> list[Drive]:
    """The drives that belong to one of the sessions."""
    return [drive for drive in drives if drive.session in set(sessions)]


def session_order(drives: Sequence[Drive], seed: int) -> np.ndarray:
    """The names of all sessions in a random order."""
    return _shuffled(sessions_of(drives), seed)


def train_test_split(
    drives: Sequence[Drive], sessions: np.ndarray
) -> tuple[list[Drive], list[Drive]]:
    """Drives of the sessions for training, and drives for the test that stops it.

    Every fourth of the sessions, in their order, is for the test; of a single session,
    every fourth drive.
    """
    drives = drives_of_sessions(drives, sessions)
    order = {name: number for number, name in enumerate(sessions)}
    numbers = np.arange(len(drives))
    if len(sessions) > 1:
        numbers = np.array([order[drive.session] for drive in drives])
    is_test = numbers % TEST_EVERY == 1
    if not is_test.any() or is_test.all():
        raise ConfigError(
            f"{counted(len(drives), 'drive')} of {counted(len(sessions), 'session')} "
            "are too few to learn and to test: record more, or shorter drives"
        )
    return _parted(drives, is_test)


def divided(drives: Sequence[Drive], steps: int) -> list[Drive]:
    """The drives, with those of a single session divided where there are too few.

    Fewer than TEST_EVERY drives cannot be split into drives to learn from and drives to
    stop by. Each is then divided into parts of about `steps` steps, and not less.
    """
    if len(drives) >= TEST_EVERY or len(np.unique(sessions_of(drives))) > 1:
        return list(drives)
    parts = []
    for drive in drives:
        count = max(1, len(drive) // steps)
        ends = np.linspace(0, len(drive), count + 1).astype(int)
        pairs = zip(ends[:-1], ends[1:], strict=True)
        parts += [part_of(drive, first, last) for first, last in pairs]
    return parts


def split(drives: Sequence[Drive], share: float, seed: int) -> Split:
    """A share of the sessions held out at random; of a single session, drives."""
    groups = groups_of(drives)
    order = _shuffled(groups, seed)
    if len(order) < 2:
        raise ConfigError(
            "a single drive leaves none to evaluate on: record another, or cut it"
        )
    count = min(max(1, round(share * len(order))), len(order) - 1)
    return _parted(drives, np.isin(groups, order[:count]))


def folds(drives: Sequence[Drive], count: int, seed: int) -> list[Split]:
    """Splits in which each session, or drive of one session, is held out once."""
    groups = groups_of(drives)
    order = _shuffled(groups, seed)
    count = min(count, len(order))
    return [
        _parted(drives, np.isin(groups, order[fold::count])) for fold in range(count)
    ]


def share_of(drives: Sequence[Drive], share: float, seed: int) -> list[Drive]:
    """Drives of a share of the sessions; a larger share has those of a smaller one."""
    groups = groups_of(drives)
    order = _shuffled(groups, seed)
    chosen = order[: max(1, round(share * len(order)))]
    return _parted(drives, np.isin(groups, chosen)).held_out


def evaluation_splits(drives: Sequence[Drive], share: float, seed: int) -> list[Split]:
    """Splits of the drives into those to learn from and those to evaluate on.

    A share of the sessions is held out if there are at least MIN_GROUPS. Otherwise each
    is held out once, in up to FOLDS folds; there is no split if there is too little to
    learn from.
    """
    groups = len(np.unique(groups_of(drives)))
    if groups < 2:
        return []
    if groups >= MIN_GROUPS:
        splits = [split(drives, share, seed)]
    else:
        splits = folds(drives, FOLDS, seed)
    steps = common_length(drives)
    fewest = min(sum(len(drive) // steps for drive in part.learn) for part in splits)
    return splits if fewest >= MIN_WINDOWS else []


def _shuffled(groups: np.ndarray, seed: int) -> np.ndarray:
    return np.random.default_rng(seed).permutation(np.unique(groups))


def _parted(drives: Sequence[Drive], flags: np.ndarray) -> Split:
    """The drives without a flag, and those with one."""
    pairs = list(zip(drives, flags, strict=True))
    return Split([d for d, flag in pairs if not flag], [d for d, flag in pairs if flag])
