"""The motion of a study on disk: collect it, load it, name it by its digest."""

from __future__ import annotations

import contextlib
import functools
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Executor
from pathlib import Path
from typing import Any

from companion.presets import Preset
from companion.trials import Dataset, Trial
from sidm.pool import local_pool
from sidm.shards import digest, load, missing_shards
from sidm.systems import SYSTEMS, System

#: Text between the name of a dataset and what of it a trial draws.
PART = ", "


def is_here(
    dataset: Dataset, data: str | Path = "data", which: Sequence[int] | None = None
) -> bool:
    """Whether a dataset, or the trajectories `which` of it, are under `data`."""
    wanted = dataset.count if which is None else which
    return not missing_shards(Path(data), dataset.collection, wanted)


@functools.lru_cache(maxsize=256)
def digest_of(
    dataset: Dataset, data: str | Path = "data", which: tuple[int, ...] | None = None
) -> str:
    """The digest of a dataset, or of the trajectories `which` of it."""
    wanted = dataset.count if which is None else which
    return digest(load(Path(data), dataset.collection, wanted))


def digests_of(used: Any, data: str | Path = "data") -> dict[str, str]:
    """The digests of all motion that a trial or another job uses, by its name.

    Of a trial's novice pool it is that of the trajectories which the trial draws.
    """
    found = {}
    for kind, dataset in used.datasets.items():
        if kind == "novice" and isinstance(used, Trial):
            drawn = sorted(index for part in used.drawn for index in part.tolist())
            name = f"{dataset.name}{PART}{used.novice_minutes:g} min, seed {used.seed}"
            found[name] = digest_of(dataset, data, tuple(drawn))
        else:
            found[dataset.name] = digest_of(dataset, data)
    return found


def all_datasets(
    preset: Preset, systems: Iterable[str] = tuple(SYSTEMS)
) -> dict[Dataset, Sequence[int]]:
    """All datasets of a preset, whole."""
    datasets = [one for system in systems for one in preset.all_datasets(system)]
    return {one: range(one.count) for one in datasets}


def collect_motion(
    needed: Mapping[Dataset, Sequence[int]],
    data: str | Path = "data",
    workers: int | None = None,
    executor: Executor | None = None,
    progress: bool = True,
    robots: Callable[[Dataset], System | None] | None = None,
) -> dict[str, str]:
    """Simulate what is missing of some trajectories.

    Args:
        needed: the indices in each dataset, as `trials.motion_of` or `all_datasets`
            give them.
        data: the folder of the shards.
        workers: processes; all cores when None.
        executor: a `concurrent.futures.Executor` instead of local processes.
        progress: whether to show bars.
        robots: gives the system of a dataset, None for a known one.

    Returns:
        Name of each dataset -> digest of what was needed of it.
    """
    from sidm.simulation import collect

    workers = workers or os.cpu_count() or 1
    pool = contextlib.nullcontext(executor) if executor else local_pool(workers)
    digests = {}
    with pool as executor:
        for dataset, which in needed.items():
            drives = collect(
                data,
                dataset.collection,
                which,
                executor=executor,
                progress=progress,
                system=robots(dataset) if robots else None,
            )
            digests[dataset.name] = digest(drives)
    return digests
