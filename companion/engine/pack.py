"""The motion that trials need as one file, for a machine without a simulator."""

from __future__ import annotations

import io
import json
import tarfile
from collections.abc import Iterable
from pathlib import Path
from typing import IO

from companion.digests import local_file
from companion.trials import Dataset, Trial
from sidm.config import ConfigError, from_mapping
from sidm.shards import SHARD_SIZE, ShardError
from sidm.storage import write_atomically

TRIALS = "trials.json"  # member of the file that lists the trials, in order
MEBIBYTE = 2**20


def files_of(dataset: Dataset, data: Path) -> list[Path]:
    """Shards and digest of a dataset under `data`.

    Raises:
        ShardError: one is missing.
    """
    shards = [
        dataset.collection.shard(data, number)
        for number in range(-(-dataset.count // SHARD_SIZE))
    ]
    paths = [*shards, local_file(dataset, data)]
    for path in paths:
        if not path.is_file():
            raise ShardError(f"{path} is missing; 'companion collect' makes it")
    return paths


def pack(
    trials: Iterable[Trial], file: Path, data: Path, limit: float = 60.0
) -> list[Trial]:
    """Write trials and the motion they need into a .tar file of at most `limit` MiB.

    Returns:
        The trials that the file holds: those whose datasets still have room.

    Raises:
        ConfigError: no trial's datasets have room.
        ShardError: motion is missing.
    """
    sizes: dict[Path, int] = {}
    taken: list[Trial] = []
    for trial in trials:
        needed = {
            path
            for dataset in trial.datasets.values()
            for path in files_of(dataset, data)
        } - set(sizes)
        more = {path: path.stat().st_size + 2 * tarfile.BLOCKSIZE for path in needed}
        if sum(sizes.values()) + sum(more.values()) <= limit * MEBIBYTE:
            sizes |= more
            taken.append(trial)
    if not taken:
        raise ConfigError(
            f"no trial's data fit into {limit:g} MiB; take a system with less, or "
            "raise the limit"
        )
    write_atomically(file, lambda target: _write(target, taken, sorted(sizes), data))
    return taken


def _write(
    target: IO[bytes], trials: list[Trial], paths: list[Path], data: Path
) -> None:
    text = json.dumps([trial.to_json() for trial in trials]).encode()
    with tarfile.open(fileobj=target, mode="w") as archive:
        entry = tarfile.TarInfo(TRIALS)
        entry.size = len(text)
        archive.addfile(entry, io.BytesIO(text))
        for path in paths:
            archive.add(path, path.relative_to(data).as_posix())


def unpack(file: Path, data: Path) -> list[Trial]:
    """Extract a pack's motion under `data` where it is missing; return its trials.

    Raises:
        ConfigError: the file is missing or is no pack.
    """
    try:
        with tarfile.open(file) as archive:
            entry = archive.extractfile(TRIALS)
            assert entry is not None
            trials = [
                from_mapping(Trial, values) for values in json.loads(entry.read())
            ]
            for member in archive.getmembers():
                if member.name != TRIALS and not (data / member.name).is_file():
                    archive.extract(member, data, filter="data")
    except FileNotFoundError:
        raise ConfigError(
            f"there is no pack '{file}'; 'companion pack' writes one"
        ) from None
    except (tarfile.TarError, KeyError, ValueError, EOFError) as error:
        raise ConfigError(
            f"{file} is no pack ({error}); 'companion pack' writes one"
        ) from None
    return trials
