"""The motion that trials learn from, read from shards once."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import IO

import numpy as np
import torch
from torch import Tensor

from companion.bodies import seen_by
from companion.engine.datasets import is_here
from companion.trials import Dataset, Trial
from sidm.body import ROVER, Body
from sidm.drives import Drive
from sidm.learning.dataset import Datasets, Windows, drive_maps, windows_of
from sidm.shards import ShardError, Which, digest, load, simulated_ground
from sidm.storage import locked, write_atomically
from sidm.systems import find_system

MAPS_AT_A_TIME = 64  # drives whose maps are in memory while a file is written


def dataset_windows(
    dataset: Dataset,
    data: str | Path,
    pixels: int,
    body: Body = ROVER,
    which: Which | None = None,
) -> Windows:
    """Windows of a dataset, or of the trajectories `which` of it, as `body` sees them.

    Maps lie in a file beside the shards, which processes share: a step of the paper's
    robots takes 96 bytes of memory, and 2 P^2 bytes of the file. ShardError says that
    motion is not there, or that a file is damaged.
    """
    collection = dataset.collection
    terrain = find_system(collection.system).terrain
    which = dataset.count if which is None else which
    drives = load(Path(data), collection, which, terrain)
    return windows_with_file(collection.folder(Path(data)), drives, pixels, body)


def windows_with_file(
    folder: Path, drives: Sequence[Drive], pixels: int, body: Body = ROVER
) -> Windows:
    """Windows of drives as `body` sees them, with maps in a file of the folder.

    The file is written where it is missing. ShardError says that it is damaged.
    """
    seen, pixels = seen_by(drives, body), body.pixels(pixels)
    if not pixels:
        return windows_of(seen, 0)
    kind = ""  # the paper's kind of map has no name
    if (body.map_size, body.pose) != (ROVER.map_size, ROVER.pose):
        kind = f"-{body.map_size:g}m-{body.pose}"
    path = folder / f"maps-{pixels}{kind}-{digest(drives)}.npy"
    return windows_of(seen, pixels, _cached_maps(path, seen, pixels))


def _cached_maps(path: Path, drives: Sequence[Drive], pixels: int) -> Tensor:
    """Maps (N, T, P, P), float16, m, in a file, which is written if it is missing."""
    shape = (len(drives), len(drives[0]), pixels, pixels)
    with locked(path):
        if not path.exists():
            write_atomically(path, lambda file: _write_maps(file, shape, drives))
    try:
        maps = np.load(path, mmap_mode="c", allow_pickle=False)
    except (OSError, ValueError, EOFError) as error:
        raise ShardError(
            f"{path}: the maps are damaged ({error}); delete the file to make it anew"
        ) from None
    if maps.shape != shape or maps.dtype != np.float16:
        raise ShardError(
            f"{path}: maps {maps.shape} where {shape} were expected; "
            "delete the file to make it anew"
        )
    return torch.from_numpy(maps)


def _write_maps(
    file: IO[bytes], shape: tuple[int, ...], drives: Sequence[Drive]
) -> None:
    """Write maps (N, T, P, P), drive by drive; each thread makes those of a drive."""
    header = {"descr": "<f2", "fortran_order": False, "shape": shape}
    np.lib.format.write_array_header_1_0(file, header)
    with ThreadPoolExecutor() as pool:
        for start in range(0, len(drives), MAPS_AT_A_TIME):
            some = drives[start : start + MAPS_AT_A_TIME]
            for maps in pool.map(drive_maps, some, [shape[-1]] * len(some)):
                file.write(maps.data)


class Library:
    """The datasets of trials, each loaded once."""

    def __init__(self, data: str | Path = "data"):
        self.data = Path(data)
        self._drives = functools.cache(functools.partial(load, self.data))
        self._windows = functools.cache(
            functools.partial(dataset_windows, data=self.data)
        )
        self._heights: dict[Dataset, Tensor] = {}

    def rollouts(self, trial: Trial) -> list[Drive]:
        """The drives of the 25-step test, in the paper's body."""
        dataset = trial.datasets["rollout"]
        return self._drives(dataset.collection, dataset.count)

    def rollout_heights(self, trial: Trial) -> Tensor:
        """Heights (B, H, W), m, of the ground of the drives of the 25-step test."""
        dataset = trial.datasets["rollout"]
        if dataset not in self._heights:
            grounds = map(simulated_ground, self.rollouts(trial))
            heights = torch.tensor(np.stack([ground.heights for ground in grounds]))
            self._heights[dataset] = heights
        return self._heights[dataset]

    def motion(
        self, trial: Trial, kind: str, which: Sequence[int] | None = None
    ) -> Windows:
        """Windows of a trial's dataset; errors as in `dataset_windows`."""
        dataset, pixels = trial.datasets[kind], trial.network.pixels
        body = trial.network.body(dataset.collection.role)
        rows = None if which is None else tuple(which)
        return self._windows(dataset, pixels=pixels, body=body, which=rows)

    def datasets(self, trial: Trial) -> Datasets:
        """The novice's train and test split, validation and the expert's windows.

        A pool that is whole on disk is loaded whole, so that trials share its maps;
        otherwise the trial's own trajectories are.
        """
        train, test = trial.drawn
        which = None
        if not is_here(trial.datasets["novice"], self.data):
            which = np.sort(np.concatenate([train, test])).tolist()
            train, test = (np.searchsorted(which, part) for part in (train, test))
        pool = self.motion(trial, "novice", which)
        validation, expert = (self.motion(trial, k) for k in ("validation", "expert"))
        return Datasets(pool.subset(train), pool.subset(test), validation, expert)
