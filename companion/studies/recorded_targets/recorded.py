"""Recorded robots as novices: their files, held-out grounds, and training subsets."""

from __future__ import annotations

import functools
import hashlib
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from companion.engine.outcomes import ROLLOUT_STEPS
from ownrobot.fitting.windows import cut, grounds_of, rollouts, split_by_ground
from ownrobot.recordings import RecordingError, read_drives
from sidm.body import ROVER
from sidm.config import ConfigError
from sidm.drives import Drive
from sidm.learning.dataset import Windows, states_and_actions, windows_of
from sidm.learning.evaluation import rollout_errors, validation_loss
from sidm.learning.model import Predictor
from sidm.shards import TEST_EVERY, trajectories_for


def recordings_of(system: str, folder: str | Path = "recordings") -> Path:
    """The file of a system's recorded novice."""
    return Path(folder) / f"{system}.npz"


def checksum_of(drives: Sequence[Drive]) -> str:
    """16 hexadecimal digits for states, actions and grounds, to the sixth decimal."""
    digest = hashlib.sha256()
    for drive in drives:
        assert drive.ground is not None
        heights, spacing = drive.ground.heights, np.array(drive.ground.spacing)
        for values in (drive.states, drive.actions, heights, spacing):
            rounded = np.round(values, 6) + 0.0  # turns -0.0 into 0.0
            digest.update(rounded.astype("<f8").tobytes())
    return digest.hexdigest()[:16]


class Recorded(NamedTuple):
    """The recordings of a system in windows, split by ground."""

    drives: list[Drive]  # windows of 64 steps
    motion: Windows  # the same windows as tensors
    training_numbers: Tensor  # numbers of the windows for training
    validation_numbers: Tensor  # numbers of the windows for validation

    @property
    def validation(self) -> Windows:
        """The windows for validation."""
        return self.motion.take(self.validation_numbers)


@functools.lru_cache(maxsize=1)  # once for all trainings; the checksum identifies them
def load_recorded(
    system: str,
    held_out: int,
    pixels: int,
    folder: str | Path = "recordings",
    wanted: str | None = None,
) -> Recorded:
    """The recordings of a system, the last `held_out` grounds for validation.

    RecordingError says that they have a fault, or another checksum than `wanted`.
    """
    path = recordings_of(system, folder)
    drives = read_drives(path, ROVER)
    checksum = checksum_of(drives)
    if wanted not in (None, checksum):
        raise RecordingError(
            f"{path}: has checksum {checksum}, the training wants {wanted}"
        )
    windows = cut(drives)
    numbers = split_by_ground(windows, held_out)
    return Recorded(windows, windows_of(windows, pixels), *numbers)


def validation_grounds(
    system: str, held_out: int, folder: str | Path = "recordings"
) -> np.ndarray:
    """(N,) number of the ground of each window for validation, without its maps."""
    windows = cut(read_drives(recordings_of(system, folder), ROVER))
    _, validation = split_by_ground(windows, held_out)
    return grounds_of(windows)[validation.numpy()]


def subsets(recorded: Recorded, minutes: float, seed: int) -> tuple[Tensor, Tensor]:
    """Numbers of the windows to train on, (n,), and to test on for stopping, (m,).

    About 75 % are to train on; the others lie on other grounds. With the same seed, the
    windows of fewer minutes are among those of more minutes, in the same split.
    ConfigError says that there are not so many minutes.
    """
    rng = np.random.default_rng(seed)
    ground = grounds_of(recorded.drives)[recorded.training_numbers.numpy()]
    grounds = rng.permutation(np.unique(ground))
    shuffled = rng.permutation(len(ground))
    test_grounds = grounds[: max(1, round(len(grounds) / TEST_EVERY))]
    is_test = np.isin(ground[shuffled], test_grounds)
    count = trajectories_for(minutes)
    tests = int((np.arange(count) % TEST_EVERY == 1).sum())
    if is_test.sum() < tests or (~is_test).sum() < count - tests:
        raise ConfigError(
            f"{minutes:g} recorded minutes are {count - tests} + {tests} windows, "
            f"but {(~is_test).sum()} + {is_test.sum()} are there"
        )
    parts = shuffled[~is_test][: count - tests], shuffled[is_test][:tests]
    train, test = (recorded.training_numbers[torch.from_numpy(part)] for part in parts)
    return train, test


def window_losses(model: Predictor, recorded: Recorded) -> Tensor:
    """Components of equation (1) on each validation window, (N, 13)."""
    numbers = recorded.validation_numbers
    windows = (recorded.motion.take(number[None]) for number in numbers)
    return torch.stack([validation_loss(model, window) for window in windows])


def path_errors(
    model: Predictor, recorded: Recorded, pixels: int
) -> tuple[Tensor, Tensor]:
    """Position error, m, and heading error, rad, (ROLLOUT_STEPS,) each.

    They are means over rollouts from the start of each validation window.
    """
    drives = [recorded.drives[n] for n in recorded.validation_numbers.tolist()]
    path = rollouts(model, drives, 0, ROLLOUT_STEPS, pixels)
    states = states_and_actions(drives)[0][:, : ROLLOUT_STEPS + 1]
    position, heading = rollout_errors(path, states)
    return position.mean(0), heading.mean(0)
