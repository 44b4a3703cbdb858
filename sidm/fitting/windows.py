"""Windows of equal length from drives: how they are split, and rollouts from them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch
from torch import Tensor

from sidm.config import ConfigError, replace
from sidm.drives import STEPS, AnyGround, Drive, SimulatedGround
from sidm.learning.dataset import TEST_EVERY, states_and_actions, windows_of
from sidm.learning.evaluation import rollout
from sidm.learning.model import Predictor
from sidm.storage import checksum

MIN_GROUPS = 8  # sessions, or drives of a single one, from which some are held out
FOLDS = 4  # parts in which fewer are held out, one after the other
MIN_WINDOWS = 2 * TEST_EVERY  # windows to learn from and to stop by, at least


def common_length(*robots: Sequence[Drive]) -> int:
    """Steps T of a window for all robots: those of the shortest drive, at most 64."""
    return min(STEPS, *(len(drive) for drives in robots for drive in drives))


def cut(drives: Sequence[Drive], steps: int = STEPS) -> list[Drive]:
    """Consecutive windows of `steps` steps, cut from the start of each drive.

    The rest of a drive, shorter than a window, is left out.

    Raises:
        ConfigError: no drive has `steps` steps.
    """
    windows = [
        replace(
            drive,
            states=drive.states[first : first + steps + 1],
            actions=drive.actions[first : first + steps],
        )
        for drive in drives
        for first in range(0, len(drive) - steps + 1, steps)
    ]
    if not windows:
        raise ConfigError(
            f"no drive of {len(drives)} has {steps} steps; record longer ones"
        )
    return windows


def first_steps(drives: Sequence[Drive], steps: int) -> list[Drive]:
    """The drives, shortened to their first `steps` steps."""
    return [
        replace(drive, states=drive.states[: steps + 1], actions=drive.actions[:steps])
        for drive in drives
    ]


def sessions_of(drives: Sequence[Drive]) -> np.ndarray:
    """(N,) text, the session of each drive."""
    return np.array([drive.session for drive in drives])


def drives_of_sessions(
    drives: Sequence[Drive], sessions: Sequence[str] | np.ndarray
) -> list[Drive]:
    """The drives that belong to one of the sessions."""
    return [drive for drive in drives if drive.session in set(sessions)]


def session_order(drives: Sequence[Drive], seed: int) -> np.ndarray:
    """The names of all sessions in a random order."""
    return np.random.default_rng(seed).permutation(np.unique(sessions_of(drives)))


def train_test_split(
    drives: Sequence[Drive], sessions: np.ndarray
) -> tuple[list[Drive], list[Drive]]:
    """Windows of the sessions for training, and windows for the test that stops it.

    Every fourth session is for the test; of a single session, every fourth window.

    Raises:
        ConfigError: too few windows for both.
    """
    windows = drives_of_sessions(drives, sessions)
    order = {name: number for number, name in enumerate(sessions)}
    numbers = np.arange(len(windows))
    if len(sessions) > 1:
        numbers = np.array([order[window.session] for window in windows])
    is_test = numbers % TEST_EVERY == 1
    if not is_test.any() or is_test.all():
        raise ConfigError(
            f"{len(windows)} windows of {len(sessions)} sessions are too few to learn "
            "and to test: record more, or shorter drives"
        )
    train, test = (
        [window for window, flag in zip(windows, flags, strict=True) if flag]
        for flags in (~is_test, is_test)
    )
    return train, test


def hold_out(drives: Sequence[Drive], share: float) -> tuple[list[Drive], list[Drive]]:
    """Drives to learn from, and the last drives, held out for evaluation.

    Whole sessions are held out; where there is a single session, drives of it. The
    held-out drives have at most a `share` of all steps, but the last session or drive
    is always held out, however long it is.

    Raises:
        ConfigError: there is only one drive.
    """
    if len(drives) < 2:
        raise ConfigError(
            "a single drive leaves none to evaluate on: record another, or cut it"
        )
    single = len({drive.session for drive in drives}) == 1
    groups: dict[str, list[Drive]] = {}
    for number, drive in enumerate(drives):
        groups.setdefault(str(number) if single else drive.session, []).append(drive)
    lengths = [sum(len(drive.actions) for drive in group) for group in groups.values()]
    remaining = np.cumsum(lengths[::-1])[::-1]  # steps from each group to the end
    fits = np.flatnonzero(remaining[1:] <= share * remaining[0])
    first = int(fits[0]) + 1 if len(fits) else len(groups) - 1
    ordered = list(groups.values())
    return sum(ordered[:first], []), sum(ordered[first:], [])


def evaluation_splits(
    drives: Sequence[Drive], share: float, seed: int
) -> list[tuple[list[Drive], list[Drive]]]:
    """Splits of the drives into those to learn from and those to evaluate on.

    Sessions are drawn at random; of a single session, drives. A share of them is held
    out if there are at least MIN_GROUPS. Otherwise each is held out once, in up to
    FOLDS folds.

    Returns:
        One split, or one for each fold; none if there is too little to learn from.
    """
    single = len({drive.session for drive in drives}) == 1
    names = np.array([str(n) if single else d.session for n, d in enumerate(drives)])
    order = np.random.default_rng(seed).permutation(np.unique(names))
    if len(order) >= MIN_GROUPS:
        held_out = [order[: max(1, round(share * len(order)))]]
    else:
        folds = min(FOLDS, len(order))
        held_out = [order[fold::folds] for fold in range(folds)]
    steps = common_length(drives)
    splits = []
    for groups in held_out:
        is_out = np.isin(names, groups)
        parts = [
            [drive for drive, flag in zip(drives, flags, strict=True) if flag]
            for flags in (~is_out, is_out)
        ]
        if sum(len(drive) // steps for drive in parts[0]) < MIN_WINDOWS:
            return []
        splits.append((parts[0], parts[1]))
    return splits


def grounds_of(drives: Sequence[Drive]) -> np.ndarray:
    """(N,) int, the number of each drive's ground.

    Grounds are numbered from 0 in the order in which they first occur. Drives without a
    ground share one number.
    """
    keys: dict[int, str] = {}
    numbers: dict[str, int] = {}
    found = []
    for drive in drives:
        ground = drive.ground
        if id(ground) not in keys:
            keys[id(ground)] = _key(ground)
        found.append(numbers.setdefault(keys[id(ground)], len(numbers)))
    return np.array(found)


def _key(ground: AnyGround | None) -> str:
    """Text that is the same for equal grounds only."""
    if ground is None:
        return ""
    if isinstance(ground, SimulatedGround):
        return f"{ground.terrain} {ground.seed}"
    return f"{checksum(ground.heights)} {ground.spacing}"


def split_by_ground(drives: Sequence[Drive], held_out: int) -> tuple[Tensor, Tensor]:
    """Numbers of the windows to learn from, (n,), and to evaluate on, (m,).

    The windows on the last `held_out` grounds are for evaluation.

    Raises:
        ValueError: `held_out` is not between 1 and the number of grounds less 1.
    """
    grounds = torch.from_numpy(grounds_of(drives))
    count = int(grounds.max()) + 1
    if not 0 < held_out < count:
        raise ValueError(f"from 1 to {count - 1} of {count} grounds, not {held_out}")
    is_held_out = grounds >= count - held_out
    return torch.nonzero(~is_held_out).flatten(), torch.nonzero(is_held_out).flatten()


def rollouts(
    model: Predictor,
    drives: Sequence[Drive],
    start: int,
    steps: int,
    pixels: int = 0,
    seen: bool = True,
) -> Tensor:
    """Open-loop predictions of K steps, from step `start` of each window.

    Args:
        model: a model of the drives' robot.
        drives: N windows of equal length.
        start: number of the step from which the model sees its own predictions.
        steps: K, the number of predicted steps.
        pixels: side of the height maps where the body does not set it.
        seen: whether the model first sees the recorded steps before `start`; otherwise
            its memory is empty at `start`.

    Returns:
        States (N, K + 1, S); the first state is the recorded one at `start`.
    """
    states, actions = states_and_actions(drives)
    path = states[:, start : start + steps + 1].clone()
    grounds, body = grounds_of(drives), drives[0].body
    for number in range(int(grounds.max()) + 1):
        rows = np.flatnonzero(grounds == number)
        group = [drives[row] for row in rows.tolist()]
        memory = None
        if seen and start:
            before = windows_of(first_steps(group, start), pixels)
            with torch.inference_mode():
                _, memory = model("novice", before.inputs, before.maps)
        heights, spacing = None, 0.0
        if body.map_size:
            ground = group[0].ground
            assert ground is not None
            heights = torch.from_numpy(ground.heights).expand(len(group), -1, -1)
            spacing = ground.spacing
        path[rows] = rollout(
            model,
            heights,
            states[rows, start],
            actions[rows, start : start + steps],
            pixels,
            spacing=spacing,
            body=body,
            memory=memory,
        )
    return path
