"""Compare figures of short examples of every kind of work with golden.json.

`make golden` adds new figures to the file, and figures of a kind whose version in
`companion.numerics` was raised; it never changes figures of today's versions.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from companion.numerics import versions

FILE = Path(__file__).with_suffix(".json")
WRITE = "SIDM_GOLDEN"  # environment variable that lets the tests write the file


class Golden:
    """The stored examples, by name: versions of their kind of work, and figures."""

    def __init__(self, file: Path = FILE, write: bool | None = None) -> None:
        self.file = file
        self.write = bool(os.environ.get(WRITE)) if write is None else write
        self.stored = json.loads(file.read_text()) if file.exists() else {}

    def hold(
        self,
        name: str,
        kind: str,
        figures: Mapping[str, float | Sequence[float]],
        rel: float,
        abs: float = 0.0,
    ) -> None:
        """Compare figures with those stored under a name.

        Raises AssertionError unless they agree to a relative or an absolute tolerance.
        """
        if self.stored.get(name, {}).get("numerics") != versions(kind):
            assert self.write, (
                f"golden.json has no '{name}' of today's versions; "
                "'make golden' writes it"
            )
            self._put(name, kind, figures)
        stored = self.stored[name]["figures"]
        assert stored.keys() == figures.keys()
        for figure, value in figures.items():
            wanted = stored[figure]
            error = np.abs(np.subtract(value, wanted))
            assert (error <= abs + rel * np.abs(wanted)).all(), (
                f"{name}: {figure} is {value}, stored is {wanted}; if it is meant "
                f"to change, raise RESULT_VERSIONS['{kind}'] in "
                "companion/numerics.py and run 'make golden'"
            )

    def _put(
        self, name: str, kind: str, figures: Mapping[str, float | Sequence[float]]
    ) -> None:
        rounded = {figure: _rounded(value) for figure, value in figures.items()}
        self.stored[name] = {"numerics": versions(kind), "figures": rounded}
        lines = [
            f"{json.dumps(key)}: {json.dumps(self.stored[key])}"
            for key in sorted(self.stored)
        ]
        self.file.write_text("{\n" + ",\n".join(lines) + "\n}\n")


def _rounded(value: float | Sequence[float]) -> float | list:
    if isinstance(value, (int, float)):
        return float(f"{value:.9g}")
    return [_rounded(number) for number in value]
