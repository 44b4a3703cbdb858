"""The datasets of a study on disk, and the digests by which trials know them.

Beside the shards of a collection lies `digests.json` (number of trajectories -> digest), written after collecting; with
the results lies `datasets.json` (dataset name -> digest) for those that the stored trials learnt from, so that reading
results needs no data. Where both speak, the data on this disk count.
"""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
from collections.abc import Iterable, Sequence
from pathlib import Path

from sidm.config import ConfigError
from sidm.experiments.pool import local_pool
from sidm.experiments.presets import Preset
from sidm.experiments.trials import UNKNOWN, Dataset, Trial
from sidm.systems import SYSTEMS
from sidm.trajectory import ShardError, Trajectory, digest, load, write_atomically

LOCAL, COMMITTED = "digests.json", "datasets.json"


def _read(path: Path) -> dict[str, str]:
    """A file of digests; empty when it is missing, ConfigError when it is damaged."""
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return {}
    except ValueError as error:
        raise ConfigError(f"{path}: not JSON ({error}); restore it, or delete it and collect again") from None
    if not isinstance(found, dict):
        raise ConfigError(f"{path}: not a table of digests; restore it, or delete it and collect again")
    return found


def _note(path: Path, entries: dict[str, str]) -> None:
    """Add entries to a file of digests, keys sorted, unless they stand there; one process at a time."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with open(path.with_name(f".{path.name}.lock"), "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        known = _read(path)
        if any(known.get(name) != value for name, value in entries.items()):
            text = json.dumps(dict(sorted((known | entries).items())), indent=1) + "\n"
            write_atomically(path, lambda file: file.write(text.encode()))


def find_digest(dataset: Dataset, data: str | Path = "data", results: str | Path = "results") -> str:
    """The digest of a dataset: of what lies under `data`, else of what the `results` were made from, else UNKNOWN."""
    local = _read(dataset.collection.folder(Path(data)) / LOCAL)
    return local.get(str(dataset.count)) or _read(Path(results) / COMMITTED).get(dataset.name, UNKNOWN)


def differing(preset: Preset, data: str | Path = "data", results: str | Path = "results") -> list[str]:
    """Names of a preset's datasets whose data on this disk are not those that the results were made from."""
    known = _read(Path(results) / COMMITTED)
    needed = [dataset for system in SYSTEMS for dataset in preset.datasets(system).values()]
    return [one.name for one in needed if one.name in known and find_digest(one, data, results) != known[one.name]]


def note_digest(dataset: Dataset, trajectories: Sequence[Trajectory], data: str | Path = "data") -> str:
    """Write the digest of a dataset beside its shards, and return it."""
    found = digest(trajectories)
    _note(dataset.collection.folder(Path(data)) / LOCAL, {str(dataset.count): found})
    return found


def note_datasets(trials: Iterable[Trial], results: str | Path = "results") -> None:
    """Write the digests that `trials` name into the results' `datasets.json`."""
    entries = {d.name: trial.digests[kind] for trial in trials for kind, d in trial.datasets.items()}
    if entries:
        _note(Path(results) / COMMITTED, entries)


def load_dataset(dataset: Dataset, wanted: str, data: str | Path = "data") -> list[Trajectory]:
    """The trajectories of a dataset from disk, held against the digest that a trial wants.

    Raises:
        ShardError: a shard is missing or damaged, or the data are not those of the trial.
    """
    trajectories = load(Path(data), dataset.collection, dataset.count)
    found = digest(trajectories)
    if found != wanted:
        raise ShardError(
            f"{dataset.collection.folder(Path(data))}: the first {dataset.count} trajectories have digest {found}, the "
            f"trial wants {wanted}; 'python -m sidm collect' notes what lies there, deleting the folder makes it anew"
        )
    return trajectories


def collect_datasets(
    preset: Preset,
    systems: Iterable[str] = tuple(SYSTEMS),
    data: str | Path = "data",
    workers: int | None = None,
    executor=None,
    progress: bool = True,
) -> dict[str, str]:
    """Simulate whatever a preset's datasets still miss and note their digests.

    Args:
        preset: the study.
        systems: names of the systems.
        data: the folder of the shards.
        workers: processes; all cores when None.
        executor: a `concurrent.futures.Executor` instead of local processes.
        progress: whether to show bars.

    Returns:
        Dataset name -> digest.

    Raises:
        ImportError: PyBullet is not installed; one line.
    """
    from sidm.simulation import collect

    found = {}
    pool = contextlib.nullcontext(executor) if executor else local_pool(workers or os.cpu_count() or 1)
    with pool as where:
        for system in systems:
            for dataset in preset.datasets(system).values():
                trajectories = collect(
                    Path(data), dataset.collection, dataset.count, executor=where, progress=progress
                )
                found[dataset.name] = note_digest(dataset, trajectories, data)
    return found
