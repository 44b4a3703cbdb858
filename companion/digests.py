"""The digests of datasets, which are part of every trial.

A collection's folder has a file `digest-COUNT.json`, which is written after collecting.
The results have such a file under `datasets/` for every dataset of a stored trial, so
that results can be read without the data. Where both files exist, the one beside the
data counts.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from companion.trials import UNKNOWN, Dataset
from sidm.config import ConfigError
from sidm.storage import Damaged, read_record


def local_file(dataset: Dataset, data: str | Path) -> Path:
    """The file with the digest of a dataset under the folder `data`."""
    return dataset.collection.folder(Path(data)) / f"digest-{dataset.count}.json"


def committed_file(dataset: Dataset, results: str | Path) -> Path:
    """The file with the digest of a dataset that the `results` were made from."""
    return Path(results) / "datasets" / f"{dataset.name}.json"


def read_digest(path: Path) -> dict[str, Any]:
    """The content of a digest file.

    Returns:
        The values by name; the `digest` alone, UNKNOWN, if there is no such file.

    Raises:
        ConfigError: the file is damaged.
    """
    try:
        record = read_record(path)
        if not isinstance(record.get("digest"), str):
            raise Damaged(f"its digest is {record.get('digest')!r}, not text")
    except FileNotFoundError:
        return {"digest": UNKNOWN}
    except Damaged as error:
        raise ConfigError(
            f"{path}: damaged ({error}); restore it, or delete it and collect again"
        ) from None
    return record


def find_digest(
    dataset: Dataset, data: str | Path = "data", results: str | Path = "results"
) -> str:
    """The digest of a dataset.

    Args:
        dataset: which one.
        data: folder of the data.
        results: folder of the results.

    Returns:
        The digest of the data; the digest in the results if there are no data, or if
        `engine.datasets.verify` has found that the data stand for those of the results;
        UNKNOWN if there is neither.

    Raises:
        ConfigError: a digest file is damaged.
    """
    local = read_digest(local_file(dataset, data))
    committed = read_digest(committed_file(dataset, results))["digest"]
    if local["digest"] == UNKNOWN or local.get("stands_for") == committed:
        return committed
    return local["digest"]
