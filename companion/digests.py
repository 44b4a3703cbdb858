"""The digests by which trials know their datasets.

Beside the shards of a collection lies a file `digest-COUNT.json`, written after
collecting; with the results lies one like it under `datasets/` for each dataset that
the stored trials learnt from, so that reading results needs no data. Where both speak,
the data on this disk count.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from companion.trials import UNKNOWN, Dataset
from sidm.config import ConfigError
from sidm.storage import Damaged, read_record


def local_file(dataset: Dataset, data: str | Path) -> Path:
    """Where the digest of a dataset that lies under `data` is noted."""
    return dataset.collection.folder(Path(data)) / f"digest-{dataset.count}.json"


def committed_file(dataset: Dataset, results: str | Path) -> Path:
    """Where the digest of a dataset that `results` were made from is noted."""
    return Path(results) / "datasets" / f"{dataset.name}.json"


def read_digest(path: Path) -> dict[str, Any]:
    """What a file says, its digest UNKNOWN when there is none; ConfigError when it is damaged."""
    try:
        found = read_record(path)
        if not isinstance(found.get("digest"), str):
            raise Damaged(f"its digest is {found.get('digest')!r}, not text")
    except FileNotFoundError:
        return {"digest": UNKNOWN}
    except Damaged as error:
        raise ConfigError(
            f"{path}: damaged ({error}); restore it, or delete it and collect again"
        ) from None
    return found


def find_digest(
    dataset: Dataset, data: str | Path = "data", results: str | Path = "results"
) -> str:
    """The digest of a dataset: of what lies under `data`, else of what the `results` were made from, else UNKNOWN.

    Of data that `verify` has found to stand for those of the results it is the
    results'.
    """
    local, committed = (
        read_digest(local_file(dataset, data)),
        read_digest(committed_file(dataset, results))["digest"],
    )
    if local["digest"] == UNKNOWN or local.get("stands_for") == committed:
        return committed
    return local["digest"]
