"""The datasets of a study on disk: collected, held against those of the results, read.

Another processor rounds otherwise, and a robot that is pushed about by rocks makes more
of it with every step: data made again elsewhere are not the same bit for bit. `verify`
holds them against the likeness that stands with the results' digest; where they are the
same but for rounding they stand for it, and rows made from them say so.
"""

from __future__ import annotations

import contextlib
import dataclasses
import os
from collections.abc import Iterable, Sequence
from concurrent.futures import Executor
from pathlib import Path
from typing import Any

from companion.digests import committed_file, find_digest, local_file, read_digest
from companion.engine.likeness import Likeness
from companion.presets import Preset
from companion.trials import UNKNOWN, Dataset, Trial
from sidm.config import from_mapping
from sidm.drives import Drive
from sidm.pool import local_pool
from sidm.shards import ShardError, digest, load
from sidm.storage import write_record
from sidm.systems import SYSTEMS


def verify(
    dataset: Dataset, data: str | Path = "data", results: str | Path = "results"
) -> list[str]:
    """How the data under `data` are not those of the results but for rounding, in words; none: they stand for them.

    Raises:
        ShardError: a shard is missing or damaged.
    """
    path, committed = (
        local_file(dataset, data),
        read_digest(committed_file(dataset, results)),
    )
    if committed["digest"] == UNKNOWN:
        return ["the results know no such data"]
    trajectories = load(Path(data), dataset.collection, dataset.count)
    found = digest(trajectories)
    if found == committed["digest"]:
        return []
    if "likeness" not in committed:
        return ["other bits, and the results keep nothing else to know them by"]
    own = Likeness.of(trajectories)
    differences = from_mapping(Likeness, committed["likeness"]).differences(own)
    noted = {"digest": found, "likeness": dataclasses.asdict(own)}
    write_record(
        path, noted if differences else noted | {"stands_for": committed["digest"]}
    )
    return differences


def is_here(trial: Trial, data: str | Path = "data") -> bool:
    """Whether the data that a trial wants have been collected under `data`, or data that stand for them."""
    return UNKNOWN not in trial.digests.values() and all(
        trial.digests[kind] in (noted["digest"], noted.get("stands_for"))
        for kind, dataset in trial.datasets.items()
        for noted in [read_digest(local_file(dataset, data))]
    )


def others(made: Any, data: str | Path = "data") -> tuple[str, ...]:
    """Kind and digest of the data under `data` that are not those of a trial, or the like, but stand for them."""
    local = {
        kind: read_digest(local_file(dataset, data))
        for kind, dataset in made.datasets.items()
    }
    return tuple(
        f"{kind} {one['digest']}"
        for kind, one in local.items()
        if one.get("stands_for") == made.digests[kind]
    )


def differing(
    preset: Preset, data: str | Path = "data", results: str | Path = "results"
) -> list[str]:
    """Names of a preset's datasets whose data on this disk do not stand for those that the results were made from."""
    needed = [dataset for system in SYSTEMS for dataset in preset.every_dataset(system)]
    known = {one: read_digest(committed_file(one, results))["digest"] for one in needed}
    return [
        one.name
        for one, noted in known.items()
        if noted not in (UNKNOWN, find_digest(one, data, results))
    ]


def note_digest(
    dataset: Dataset, trajectories: Sequence[Drive], data: str | Path = "data"
) -> str:
    """Write the digest and the likeness of a dataset beside its shards, and return the digest."""
    found, path = digest(trajectories), local_file(dataset, data)
    if read_digest(path)["digest"] != found:
        write_record(
            path,
            {
                "digest": found,
                "likeness": dataclasses.asdict(Likeness.of(trajectories)),
            },
        )
    return found


def note_committed(
    dataset: Dataset,
    found: str,
    data: str | Path = "data",
    results: str | Path = "results",
) -> None:
    """Write the digest of a dataset, with its likeness where it lies under `data`, into the results' `datasets/`."""
    path, local = (
        committed_file(dataset, results),
        read_digest(local_file(dataset, data)),
    )
    if read_digest(path)["digest"] != found:
        write_record(path, local if local["digest"] == found else {"digest": found})


def note_collected(
    dataset: Dataset, data: str | Path = "data", results: str | Path = "results"
) -> None:
    """Write what lies under `data` into the results' `datasets/`, unless it stands for what is written there."""
    local, known = (
        read_digest(local_file(dataset, data)),
        read_digest(committed_file(dataset, results))["digest"],
    )
    if known not in (local["digest"], local.get("stands_for")) and (
        known == UNKNOWN or verify(dataset, data, results)
    ):
        note_committed(dataset, local["digest"], data, results)


def note_datasets(
    trials: Iterable[Trial], data: str | Path = "data", results: str | Path = "results"
) -> None:
    """Write what `trials` learn from into the results' `datasets/`."""
    entries = {
        dataset: trial.digests[kind]
        for trial in trials
        for kind, dataset in trial.datasets.items()
    }
    for dataset, found in entries.items():
        note_committed(dataset, found, data, results)


def load_dataset(
    dataset: Dataset, wanted: str, data: str | Path = "data"
) -> list[Drive]:
    """The trajectories of a dataset from disk, held against the digest that a trial wants.

    Raises:
        ShardError: a shard is missing or damaged, or the data are not those of the
            trial.
    """
    trajectories = load(Path(data), dataset.collection, dataset.count)
    found = digest(trajectories)
    noted = read_digest(local_file(dataset, data))
    if found != wanted and (noted["digest"], noted.get("stands_for")) != (
        found,
        wanted,
    ):
        raise ShardError(
            f"{dataset.collection.folder(Path(data))}: the first {dataset.count} trajectories have digest {found}, the "
            f"trial wants {wanted}; 'companion collect --verify' sees whether they differ by rounding alone"
        )
    return trajectories


def verify_datasets(
    needed: Iterable[Dataset],
    data: str | Path = "data",
    results: str | Path = "results",
) -> dict[str, list[str]]:
    """`verify` of some datasets, by their names.

    Raises:
        ShardError: a shard is missing or damaged.
    """
    return {dataset.name: verify(dataset, data, results) for dataset in needed}


def collect_datasets(
    preset: Preset,
    systems: Iterable[str] = tuple(SYSTEMS),
    data: str | Path = "data",
    workers: int | None = None,
    executor: Executor | None = None,
    progress: bool = True,
    needed: Iterable[Dataset] = (),
) -> dict[str, str]:
    """Simulate whatever a preset's datasets still miss and note their digests.

    Args:
        preset: the study.
        systems: names of the systems.
        data: the folder of the shards.
        workers: processes; all cores when None.
        executor: a `concurrent.futures.Executor` instead of local processes.
        progress: whether to show bars.
        needed: these instead of all that the preset's trials of the systems need.

    Returns:
        Dataset name -> digest.

    Raises:
        ImportError: PyBullet is not installed; one line.
    """
    needed = list(needed) or [
        dataset for system in systems for dataset in preset.every_dataset(system)
    ]
    pool = (
        contextlib.nullcontext(executor)
        if executor
        else local_pool(workers or os.cpu_count() or 1)
    )
    with pool as where:
        return {
            dataset.name: collect_dataset(dataset, data, where, progress)
            for dataset in needed
        }


def collect_dataset(
    dataset: Dataset,
    data: str | Path = "data",
    executor: Executor | None = None,
    progress: bool = True,
) -> str:
    """Simulate whatever a dataset still misses and note its digest, which is returned; as `collect_datasets`."""
    from sidm.simulation import collect

    found = collect(
        Path(data),
        dataset.collection,
        dataset.count,
        executor=executor,
        progress=progress,
    )
    return note_digest(dataset, found, data)
