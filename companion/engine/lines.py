"""Values as JSON lines, each with a checksum.

A line is appended whole. A last line that was never finished counts for nothing, and
the next one is written in its place.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from sidm.config import first_line
from sidm.storage import Damaged, write_atomically

CHECKSUM = ', "checksum": "'  # text of a line between its values and its checksum
DIGITS = 16  # hexadecimal, of a checksum


def line_of(values: Mapping[str, Any]) -> str:
    """A mapping of JSON types as a line with a checksum."""
    text = json.dumps(values, allow_nan=False)[:-1]
    return f'{text}{CHECKSUM}{_digest(text)}"}}\n'


def values_of(line: str) -> dict[str, Any]:
    """The values of a line; Damaged where it is not as it was written."""
    text, key, rest = line.rpartition(CHECKSUM)
    if not key or rest != f'{_digest(text)}"}}':
        raise Damaged("its checksum does not match")
    return json.loads(text + "}")


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()[:DIGITS]


def read_lines(path: Path) -> Iterator[dict[str, Any]]:
    """The values of every whole line of a file."""
    for number, line in enumerate(path.read_bytes().split(b"\n")[:-1], 1):
        try:
            yield values_of(line.decode())
        except (ValueError, RecursionError) as error:
            raise Damaged(f"line {number}: {first_line(error)}") from None


def write_lines(path: Path, records: Iterable[Mapping[str, Any]]) -> None:
    """Write a file of lines, in place of an older one."""
    text = "".join(map(line_of, records))
    write_atomically(path, lambda file: file.write(text.encode()))


def append(path: Path, content: bytes, end: int) -> None:
    """Write behind the first `end` bytes of a file; what was never finished goes."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with open(path, "r+b" if path.exists() else "xb") as file:
        file.truncate(end)
        file.seek(end)
        file.write(content)
        file.flush()
        os.fsync(file.fileno())
