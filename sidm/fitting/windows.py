"""Drives cut into windows of equal length: which are learnt from, which judge, and rollouts from each."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch
from torch import Tensor

from sidm.config import ConfigError, replace
from sidm.drives import STEPS, AnyGround, Drive, SimulatedGround
from sidm.learning.dataset import TEST_EVERY, stacked, windows_of
from sidm.learning.evaluation import rollout
from sidm.learning.model import Predictor
from sidm.storage import checksum


def common_length(*robots: Sequence[Drive]) -> int:
    """Steps T of a window, the same for all that learn together: those of the shortest drive, at most 64."""
    return min(STEPS, *(len(drive) for drives in robots for drive in drives))


def cut(drives: Sequence[Drive], steps: int = STEPS) -> list[Drive]:
    """Windows of `steps` from the beginning of each drive on, less what is left over at its end.

    Raises:
        ConfigError: no drive is as long.
    """
    found = [
        replace(
            drive,
            states=drive.states[first : first + steps + 1],
            actions=drive.actions[first : first + steps],
        )
        for drive in drives
        for first in range(0, len(drive) - steps + 1, steps)
    ]
    if not found:
        raise ConfigError(
            f"no drive of {len(drives)} has {steps} steps; record longer ones"
        )
    return found


def begun(drives: Sequence[Drive], steps: int) -> list[Drive]:
    """The first steps of drives."""
    return [
        replace(drive, states=drive.states[: steps + 1], actions=drive.actions[:steps])
        for drive in drives
    ]


def sessions_of(drives: Sequence[Drive]) -> np.ndarray:
    """(N,) text: the session of each drive."""
    return np.array([drive.session for drive in drives])


def of_sessions(
    drives: Sequence[Drive], sessions: Sequence[str] | np.ndarray
) -> list[Drive]:
    """The drives of some sessions."""
    return [drive for drive in drives if drive.session in set(sessions)]


def session_order(drives: Sequence[Drive], seed: int) -> np.ndarray:
    """The names of all sessions in a random order."""
    return np.random.default_rng(seed).permutation(np.unique(sessions_of(drives)))


def learn_and_test(
    drives: Sequence[Drive], sessions: np.ndarray
) -> tuple[list[Drive], list[Drive]]:
    """Windows to learn from and windows to stop by: of four sessions one tests; of a single one every fourth window.

    Raises:
        ConfigError: too few windows for both.
    """
    mine = of_sessions(drives, sessions)
    order = {name: number for number, name in enumerate(sessions)}
    number = (
        np.array([order[one.session] for one in mine])
        if len(sessions) > 1
        else np.arange(len(mine))
    )
    testing = number % TEST_EVERY == 1
    if not testing.any() or testing.all():
        raise ConfigError(
            f"{len(mine)} windows of {len(sessions)} sessions are too few to learn and to test: record more, or "
            "shorter drives"
        )
    learning = [drive for drive, tests in zip(mine, testing, strict=True) if not tests]
    return learning, [
        drive for drive, tests in zip(mine, testing, strict=True) if tests
    ]


def hold_out(drives: Sequence[Drive], share: float) -> tuple[list[Drive], list[Drive]]:
    """Drives to learn from and to judge by: whole sessions, or of a single one its drives, the last.

    The drives to judge by have at most a `share` of all steps. The last session or
    drive always judges, however long.

    Raises:
        ConfigError: there is but one drive.
    """
    if len(drives) < 2:
        raise ConfigError(
            "a single drive leaves none to judge by: record another, or cut it in two"
        )
    alone = len({drive.session for drive in drives}) == 1
    units: dict[str, list[Drive]] = {}
    for number, drive in enumerate(drives):
        units.setdefault(str(number) if alone else drive.session, []).append(drive)
    lengths = [sum(len(drive.actions) for drive in unit) for unit in units.values()]
    left = np.cumsum(lengths[::-1])[::-1]  # steps from each unit to the end
    first = next(
        (n for n in range(1, len(left)) if left[n] <= share * left[0]), len(left) - 1
    )
    grouped = list(units.values())
    return sum(grouped[:first], []), sum(grouped[first:], [])


def grounds_of(drives: Sequence[Drive]) -> np.ndarray:
    """(N,) int: which ground each drive is on, by the order in which they first come; 0 where there is none."""
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
    """What equal grounds have in common."""
    if ground is None:
        return ""
    if isinstance(ground, SimulatedGround):
        return f"{ground.terrain} {ground.seed}"
    return f"{checksum(ground.heights)} {ground.spacing}"


def apart_by_ground(drives: Sequence[Drive], held_out: int) -> tuple[Tensor, Tensor]:
    """Numbers (n,) of the windows to learn from and (m,) of those to judge by: those on the last `held_out` grounds.

    Raises:
        ValueError: as many grounds or more are to be held out as there are.
    """
    grounds = torch.from_numpy(grounds_of(drives))
    count = int(grounds.max()) + 1
    if not 0 < held_out < count:
        raise ValueError(f"from 1 to {count - 1} of {count} grounds, not {held_out}")
    judging = grounds >= count - held_out
    return torch.nonzero(~judging).flatten(), torch.nonzero(judging).flatten()


def rollouts(
    model: Predictor,
    drives: Sequence[Drive],
    start: int,
    steps: int,
    pixels: int = 0,
    seen: bool = True,
) -> Tensor:
    """What a model predicts open loop for K steps from step `start` of each window on.

    Args:
        model: of the drives' robot.
        drives: N windows of equal length.
        start: the step from which on the model sees its own predictions.
        steps: K.
        pixels: a side of the maps where the body does not say how many.
        seen: whether the model has seen the steps before, or begins there from the same
            state.

    Returns:
        States (N, K + 1, S), the given ones at `start` first.
    """
    states, actions = stacked(drives)
    path, grounds, body = (
        states[:, start : start + steps + 1].clone(),
        grounds_of(drives),
        drives[0].body,
    )
    for number in range(int(grounds.max()) + 1):
        which = np.flatnonzero(grounds == number)
        some, memory = [drives[one] for one in which.tolist()], None
        if seen and start:
            before = windows_of(begun(some, start), pixels)
            with torch.inference_mode():
                _, memory = model("novice", before.inputs, before.maps)
        heights, spacing = None, 0.0
        if body.map_size:
            ground = some[0].ground
            assert ground is not None
            heights, spacing = (
                torch.from_numpy(ground.heights).expand(len(some), -1, -1),
                ground.spacing,
            )
        path[which] = rollout(
            model,
            heights,
            states[which, start],
            actions[which, start : start + steps],
            pixels,
            spacing=spacing,
            body=body,
            memory=memory,
        )
    return path
