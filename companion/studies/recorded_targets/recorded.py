"""Recorded robots as novices: their files, the grounds that judge, and subsets to learn from."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from companion.engine.execute import ROLLOUT_STEPS
from sidm.body import ROVER
from sidm.config import ConfigError
from sidm.drives import Drive
from sidm.fitting.windows import apart_by_ground, cut, grounds_of, rollouts
from sidm.learning.dataset import TEST_EVERY, Windows, stacked, windows_of
from sidm.learning.evaluation import rollout_errors, validation_loss
from sidm.learning.model import Predictor
from sidm.recordings import RecordingError, read_drives
from sidm.shards import trajectories_for


def recordings_of(system: str, folder: str | Path = "recordings") -> Path:
    """The file of a system's recorded novice."""
    return Path(folder) / f"{system}.npz"


def checksum_of(drives: Sequence[Drive]) -> str:
    """16 hexadecimal digits for what was read: states, actions and grounds, to the sixth decimal."""
    digest = hashlib.sha256()
    for one in drives:
        assert one.ground is not None
        for values in (
            one.states,
            one.actions,
            one.ground.heights,
            np.array(one.ground.spacing),
        ):
            # + 0.0: no -0.0
            digest.update((np.round(values, 6) + 0.0).astype("<f8").tobytes())
    return digest.hexdigest()[:16]


class Recorded(NamedTuple):
    """The recordings of a system, apart by ground."""

    drives: list[Drive]  # windows of 64 steps
    motion: Windows  # the same as tensors
    learning: Tensor  # numbers of the windows to learn from
    judging: Tensor  # and of those to judge by

    @property
    def judges(self) -> Windows:
        """The motion to judge by."""
        return self.motion.take(self.judging)


def load_recorded(
    system: str,
    held_out: int,
    pixels: int,
    folder: str | Path = "recordings",
    wanted: str | None = None,
) -> Recorded:
    """A system's recordings, the last `held_out` grounds to judge by.

    Raises:
        RecordingError: they have a fault, or another checksum than is `wanted`.
    """
    path = recordings_of(system, folder)
    drives = read_drives(path, ROVER)
    if wanted not in (None, found := checksum_of(drives)):
        raise RecordingError(
            f"{path}: has checksum {found}, the training wants {wanted}"
        )
    windows = cut(drives)
    return Recorded(
        windows, windows_of(windows, pixels), *apart_by_ground(windows, held_out)
    )


def subsets(recorded: Recorded, minutes: float, seed: int) -> tuple[Tensor, Tensor]:
    """Numbers (n,) of the pieces to train on, about 75 %, and (m,) of those to stop by, which lie on other grounds.

    Of one seed, the pieces of fewer minutes are among those of more, and in the same
    part.

    Raises:
        ConfigError: so much is not there.
    """
    rng, ground = (
        np.random.default_rng(seed),
        grounds_of(recorded.drives)[recorded.learning.numpy()],
    )
    grounds = rng.permutation(np.unique(ground))
    shuffled = rng.permutation(len(ground))
    testing = np.isin(
        ground[shuffled], grounds[: max(1, round(len(grounds) / TEST_EVERY))]
    )
    count = trajectories_for(minutes)
    tests = int((np.arange(count) % TEST_EVERY == 1).sum())
    if testing.sum() < tests or (~testing).sum() < count - tests:
        there = f"{(~testing).sum()} + {testing.sum()}"
        raise ConfigError(
            f"{minutes:g} recorded minutes are {count - tests} + {tests} pieces, but {there} are there"
        )
    parts = shuffled[~testing][: count - tests], shuffled[testing][:tests]
    train, test = (recorded.learning[torch.from_numpy(part)] for part in parts)
    return train, test


def piece_losses(model: Predictor, recorded: Recorded) -> Tensor:
    """(N, 13): the components of equation (1) on each piece that judges."""
    judges = recorded.judges
    numbers = torch.arange(len(recorded.judging))
    return torch.stack(
        [validation_loss(model, judges.take(one[None])) for one in numbers]
    )


def path_errors(
    model: Predictor, recorded: Recorded, pixels: int
) -> tuple[Tensor, Tensor]:
    """(K,) m and (K,) rad, K = ROLLOUT_STEPS: position and heading from the start of each piece that judges, mean."""
    judges = [recorded.drives[number] for number in recorded.judging.tolist()]
    path, states = (
        rollouts(model, judges, 0, ROLLOUT_STEPS, pixels),
        stacked(judges)[0][:, : ROLLOUT_STEPS + 1],
    )
    position, heading = rollout_errors(path, states)
    return position.mean(0), heading.mean(0)
