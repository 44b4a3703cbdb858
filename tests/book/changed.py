"""Stored results with their values exchanged between trials.

No claim of the book holds for them.
"""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any
from unittest.mock import patch

from sidm.storage import read_record, write_record

#: beginnings of the names of values whose lengths differ
ANY_LENGTH = ("curve", "rollouts")
ANY_LENGTH += ("component_samples", "component_test", "component_validation")
KEPT = ("about", "trial", "provenance", "schema")  # these values stay


@patch("os.fsync", lambda file: None)  # thousands of files that no one keeps
def change(results: Path, copy: Path) -> None:
    """Copy a folder of results and exchange values of records of one kind and shape.

    Accuracies of telling latents apart become 0.5, those of chance.
    """
    shutil.copytree(results, copy)
    for folder in (path for path in copy.iterdir() if path.is_dir()):
        groups: dict[str, list[Path]] = {}
        for path in (
            sorted(folder.glob("*.json"))
            if folder.name not in ("datasets", "explorer")
            else ()
        ):
            groups.setdefault(json.dumps(shape(found(path))), []).append(path)
        for paths in groups.values():
            values = [read_record(path) for path in paths]
            for path, own, other in zip(paths, values, reversed(values), strict=True):
                values_now = {
                    name: own[name] if name in KEPT else other[name] for name in own
                }
                by_chance = {
                    name: 0.5 for name in values_now if name.endswith("_accuracy")
                }
                write_record(path, values_now | by_chance)


def found(path: Path) -> dict[str, Any]:
    """Values that a record found, without what the record is about."""
    return {
        name: value for name, value in read_record(path).items() if name not in KEPT
    }


def shape(value: Any) -> Any:
    """Names and lengths of nested values; lengths of curves are left out."""
    if isinstance(value, dict):
        return {
            name: shape(inner)
            for name, inner in value.items()
            if not name.startswith(ANY_LENGTH)
        }
    if isinstance(value, list):
        return [len(value), shape(value[0]) if value else None]
    return None
