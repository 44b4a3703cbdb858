"""Figures of short examples of every kind of work, held against those in golden.json.

`make golden` writes there what is new and what belongs to a kind whose version in
`companion.numerics` was raised; figures of today's versions are never written over.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from companion.numerics import versions

FILE = Path(__file__).with_suffix(".json")
WRITE = "SIDM_GOLDEN"  # the environment variable that asks for writing


class Golden:
    """The stored examples by name: kinds of work with their versions, and figures."""

    def __init__(self, file: Path = FILE, write: bool | None = None) -> None:
        self.file, self.write = (
            file,
            bool(os.environ.get(WRITE)) if write is None else write,
        )
        self.stored = json.loads(file.read_text()) if file.exists() else {}

    def hold(
        self,
        name: str,
        kind: str,
        figures: Mapping[str, float | Sequence[float]],
        rel: float,
        abs: float = 0.0,
    ) -> None:
        """AssertionError unless `figures` are those stored under `name`, to a relative
        or an absolute tolerance."""
        if self.stored.get(name, {}).get("numerics") != versions(kind):
            assert self.write, (
                f"golden.json has no '{name}' of today's versions; 'make golden' writes it"
            )
            self._put(name, kind, figures)
        stored = self.stored[name]["figures"]
        assert stored.keys() == figures.keys()
        for what, value in figures.items():
            differing = np.abs(np.subtract(value, stored[what])) > abs + rel * np.abs(
                stored[what]
            )
            assert not differing.any(), (
                f"{name}: {what} is {value}, stored is {stored[what]}; if it is meant to change, raise "
                f"NUMERICS['{kind}'] in companion/numerics.py and run 'make golden'"
            )

    def _put(
        self, name: str, kind: str, figures: Mapping[str, float | Sequence[float]]
    ) -> None:
        rounded = {what: _rounded(value) for what, value in figures.items()}
        self.stored[name] = {"numerics": versions(kind), "figures": rounded}
        lines = [
            f"{json.dumps(one)}: {json.dumps(self.stored[one])}"
            for one in sorted(self.stored)
        ]
        self.file.write_text("{\n" + ",\n".join(lines) + "\n}\n")


def _rounded(value: float | Sequence[float]) -> float | list:
    if isinstance(value, (int, float)):
        return float(f"{value:.9g}")
    return [_rounded(one) for one in value]
