"""Height maps of the steps of drives, computed once and cached in a file."""

from __future__ import annotations

import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import IO

import numpy as np
import torch
from torch import Tensor

from sidm.body import Body
from sidm.config import ConfigError
from sidm.drives import Drive
from sidm.learning import observation
from sidm.shards import ShardError
from sidm.storage import locked, write_atomically

MAPS_AT_A_TIME = 64  # drives whose maps are in memory while a file is written


def drive_maps(drive: Drive, pixels: int, body: Body) -> np.ndarray:
    """Maps (T, P, P), float16, in m, as `body` sees them at the start of each step."""
    ground = drive.ground
    if ground is None:
        raise ConfigError(
            f"{drive.name}: body '{body.name}' sees a height map, "
            "and the drive has no ground"
        )
    heights = ground.heights
    states, actions = map(torch.from_numpy, (drive.states[:-1], drive.actions))
    states, _ = states_for_body(body, drive.body, states, actions)
    maps = observation.robot_centred_map(
        heights, states, pixels, body.map_size, ground.spacing, body
    )
    return maps.numpy().astype(np.float16)


def cached_maps(path: Path, drives: Sequence[Drive], pixels: int, body: Body) -> Tensor:
    """Maps (N, T, P, P), float16, in m, of N drives, from the file at `path`.

    The file is written where it is missing. The maps stay in it until they are used.
    """
    shape = (len(drives), len(drives[0]), pixels, pixels)
    with locked(path):
        if not path.exists():
            write_atomically(path, lambda file: _write(file, shape, drives, body))
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


def _write(
    file: IO[bytes], shape: tuple[int, ...], drives: Sequence[Drive], body: Body
) -> None:
    """Write maps (N, T, P, P), drive by drive; each core makes those of a drive."""
    header = {
        "descr": np.lib.format.dtype_to_descr(np.dtype(np.float16)),
        "fortran_order": False,
        "shape": shape,
    }
    np.lib.format.write_array_header_1_0(file, header)
    with ThreadPoolExecutor(_available_cores()) as pool:
        for start in range(0, len(drives), MAPS_AT_A_TIME):
            some_drives = drives[start : start + MAPS_AT_A_TIME]
            for maps in pool.map(
                lambda drive: drive_maps(drive, shape[-1], body), some_drives
            ):
                file.write(maps.data)


def _available_cores() -> int:
    """Number of cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def states_for_body(
    body: Body, recorded: Body, states: Tensor, actions: Tensor
) -> tuple[Tensor, Tensor]:
    """States and actions of the `recorded` body in the form of `body`."""
    if recorded == body:
        return states, actions
    return observation.convert_to_body(body, states, actions)
