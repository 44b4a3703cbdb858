"""Stored results with their values exchanged between trials.

No claim of the book holds for them.
"""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

from companion.engine.lines import read_lines, write_lines

KEPT = ("key", "about", "trial", "provenance")  # these values stay


def change(results: Path, copy: Path) -> None:
    """Copy a folder of results and exchange values of records of one kind and shape.

    Accuracies of telling latents apart become 0.5, those of chance.
    """
    shutil.copytree(results, copy)
    for path in copy.rglob("*.jsonl"):
        if path.stem == "datasets":
            continue
        records = list(read_lines(path))
        groups: dict[str, list[int]] = {}
        for number, record in enumerate(records):
            groups.setdefault(json.dumps(shape(found(record))), []).append(number)
        changed = list(records)
        for numbers in groups.values():
            for number, other in zip(numbers, reversed(numbers), strict=True):
                kept = {k: v for k, v in records[number].items() if k in KEPT}
                values = kept | found(records[other])
                chance = {name: 0.5 for name in values if name.endswith("_accuracy")}
                changed[number] = values | chance
        write_lines(path, changed)


def found(record: dict[str, Any]) -> dict[str, Any]:
    """Values that a record found, without what the record is about."""
    return {name: value for name, value in record.items() if name not in KEPT}


def shape(value: Any) -> Any:
    """Names and lengths of nested values; lengths of curves are left out."""
    if isinstance(value, dict):
        return {
            name: shape(inner)
            for name, inner in value.items()
            if not name.startswith("curve")
        }
    if isinstance(value, list):
        return [len(value), shape(value[0]) if value else None]
    return None
