"""The datasets of a study on disk: collect, verify and load them.

Another processor rounds differently, and contact amplifies the difference with every
step: a dataset that is simulated again elsewhere has other bits. `verify` compares it
with the likeness that is stored beside the digest in the results. A dataset that
differs by rounding alone stands for the results' one, and rows made from it say so.
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
    """How a dataset under `data` differs from the results' one by more than rounding.

    Without differences, a note is written that the dataset stands for the results' one.

    Returns:
        The differences in words, one entry each.

    Raises:
        ShardError: a shard is missing or damaged.
    """
    path = local_file(dataset, data)
    committed = read_digest(committed_file(dataset, results))
    if committed["digest"] == UNKNOWN:
        return ["the results know no such data"]
    trajectories = load(Path(data), dataset.collection, dataset.count)
    local_digest = digest(trajectories)
    if local_digest == committed["digest"]:
        return []
    if "likeness" not in committed:
        return ["the data differ, and the results store no likeness to compare"]
    likeness = Likeness.of(trajectories)
    differences = from_mapping(Likeness, committed["likeness"]).differences(likeness)
    note = {"digest": local_digest, "likeness": dataclasses.asdict(likeness)}
    if not differences:
        note["stands_for"] = committed["digest"]
    write_record(path, note)
    return differences


def is_here(trial: Trial, data: str | Path = "data") -> bool:
    """Whether a trial's datasets, or datasets that stand for them, are under `data`."""
    notes = {
        kind: read_digest(local_file(dataset, data))
        for kind, dataset in trial.datasets.items()
    }
    return UNKNOWN not in trial.digests.values() and all(
        trial.digests[kind] in (note["digest"], note.get("stands_for"))
        for kind, note in notes.items()
    )


def substitute_digests(made: Any, data: str | Path = "data") -> tuple[str, ...]:
    """Kind and digest of each dataset under `data` that stands for one of a trial's.

    Args:
        made: an object with `datasets` and their `digests`, such as a Trial.
        data: the folder of the datasets.
    """
    local = {
        kind: read_digest(local_file(dataset, data))
        for kind, dataset in made.datasets.items()
    }
    return tuple(
        f"{kind} {note['digest']}"
        for kind, note in local.items()
        if note.get("stands_for") == made.digests[kind]
    )


def differing_names(
    preset: Preset, data: str | Path = "data", results: str | Path = "results"
) -> list[str]:
    """Names of a preset's datasets under `data` that differ from the results' ones."""
    needed = [dataset for system in SYSTEMS for dataset in preset.all_datasets(system)]
    committed = {
        dataset: read_digest(committed_file(dataset, results))["digest"]
        for dataset in needed
    }
    return [
        dataset.name
        for dataset, known in committed.items()
        if known not in (UNKNOWN, find_digest(dataset, data, results))
    ]


def note_digest(
    dataset: Dataset, trajectories: Sequence[Drive], data: str | Path = "data"
) -> str:
    """Write the digest and the likeness of a dataset beside its shards.

    Returns:
        The digest.
    """
    path, new = local_file(dataset, data), digest(trajectories)
    if read_digest(path)["digest"] != new:
        likeness = dataclasses.asdict(Likeness.of(trajectories))
        write_record(path, {"digest": new, "likeness": likeness})
    return new


def note_committed(
    dataset: Dataset,
    known: str,
    data: str | Path = "data",
    results: str | Path = "results",
) -> None:
    """Write the digest of a dataset into the results' `datasets/`.

    The likeness is written, too, where the dataset is under `data`.
    """
    path = committed_file(dataset, results)
    local = read_digest(local_file(dataset, data))
    if read_digest(path)["digest"] != known:
        write_record(path, local if local["digest"] == known else {"digest": known})


def note_collected(
    dataset: Dataset, data: str | Path = "data", results: str | Path = "results"
) -> None:
    """Write the digest of a collected dataset into the results' `datasets/`.

    A dataset that stands for the results' one changes nothing there.
    """
    local = read_digest(local_file(dataset, data))
    known = read_digest(committed_file(dataset, results))["digest"]
    if known not in (local["digest"], local.get("stands_for")) and (
        known == UNKNOWN or verify(dataset, data, results)
    ):
        note_committed(dataset, local["digest"], data, results)


def note_datasets(
    trials: Iterable[Trial], data: str | Path = "data", results: str | Path = "results"
) -> None:
    """Write the digests of all datasets of `trials` into the results' `datasets/`."""
    entries = {
        dataset: trial.digests[kind]
        for trial in trials
        for kind, dataset in trial.datasets.items()
    }
    for dataset, known in entries.items():
        note_committed(dataset, known, data, results)


def load_dataset(
    dataset: Dataset, wanted: str, data: str | Path = "data"
) -> list[Drive]:
    """The drives of a dataset from disk, checked by the digest that a trial wants.

    Raises:
        ShardError: a shard is missing or damaged, or the data are not those of the
            trial.
    """
    trajectories = load(Path(data), dataset.collection, dataset.count)
    local = digest(trajectories)
    note = read_digest(local_file(dataset, data))
    stands_for = note.get("stands_for") if note["digest"] == local else None
    if wanted not in (local, stands_for):
        folder = dataset.collection.folder(Path(data))
        raise ShardError(
            f"{folder}: the first {dataset.count} trajectories have digest {local}, "
            f"the trial wants {wanted}; 'companion collect --verify' sees whether they "
            "differ by rounding alone"
        )
    return trajectories


def verify_datasets(
    needed: Iterable[Dataset],
    data: str | Path = "data",
    results: str | Path = "results",
) -> dict[str, list[str]]:
    """Results of `verify`, by the names of the datasets.

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
    """Simulate what is missing of a preset's datasets and note their digests.

    Args:
        preset: the study.
        systems: names of the systems.
        data: the folder of the shards.
        workers: processes; all cores when None.
        executor: a `concurrent.futures.Executor` instead of local processes.
        progress: whether to show bars.
        needed: the datasets, instead of all that the preset's trials need.

    Returns:
        Dataset name -> digest.

    Raises:
        ImportError: PyBullet is not installed; the message is one line.
    """
    needed = list(needed) or [
        dataset for system in systems for dataset in preset.all_datasets(system)
    ]
    workers = workers or os.cpu_count() or 1
    pool = contextlib.nullcontext(executor) if executor else local_pool(workers)
    with pool as executor:
        return {
            dataset.name: collect_dataset(dataset, data, executor, progress)
            for dataset in needed
        }


def collect_dataset(
    dataset: Dataset,
    data: str | Path = "data",
    executor: Executor | None = None,
    progress: bool = True,
) -> str:
    """Simulate what is missing of a dataset; note and return its digest.

    Arguments and errors are those of `collect_datasets`.
    """
    from sidm.simulation import collect

    collection, count = dataset.collection, dataset.count
    drives = collect(
        Path(data), collection, count, executor=executor, progress=progress
    )
    return note_digest(dataset, drives, data)
