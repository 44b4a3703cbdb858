"""A copy of the stored results in which each was found by another trial: no claim of
the book is borne out by it."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

from sidm.storage import read_record, write_record

ANY_LENGTH = (
    "curve",
    "component_samples",
    "component_test",
    "component_validation",
    "rollouts",
)
KEPT = ("about", "trial", "provenance", "schema")  # what a result is about stays


def change(results: Path, copy: Path) -> None:
    """Copy a folder of results and let those of one kind and shape change places;
    latents are told apart by chance."""
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
    """What a record found."""
    return {
        name: value for name, value in read_record(path).items() if name not in KEPT
    }


def shape(value: Any) -> Any:
    """Names and lengths of nested values, of curves none."""
    if isinstance(value, dict):
        return {
            name: shape(one)
            for name, one in value.items()
            if not name.startswith(ANY_LENGTH)
        }
    return (
        [len(value), shape(value[0]) if value else None]
        if isinstance(value, list)
        else None
    )
