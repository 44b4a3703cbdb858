"""Records as JSON lines, each with a checksum; long curves beside them, compressed.

A record is one line of NAME.jsonl. Its long columns lie in NAME.curves.gz, a member of
gzip for each record, at the place that the line names. A line is appended whole, after
its curves; of two lines about the same thing the later one counts.
"""

from __future__ import annotations

import functools
import gzip
import hashlib
import json
import os
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from sidm.config import first_line
from sidm.storage import Damaged, locked, write_atomically

CHECKSUM = ', "checksum": "'  # text of a line between its values and its checksum
DIGITS = 16  # hexadecimal, of a checksum
AT = "curves_at"  # field of a line: offset and length of its curves, bytes


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
    """The values of every line of a file.

    A last line that was never finished is left out.
    """
    for number, line in enumerate(path.read_bytes().split(b"\n")[:-1], 1):
        try:
            yield values_of(line.decode())
        except (ValueError, RecursionError) as error:
            raise Damaged(f"line {number}: {first_line(error)}") from None


def write_lines(path: Path, records: Iterable[Mapping[str, Any]]) -> None:
    """Write a file of lines, in place of an older one."""
    text = "".join(map(line_of, records))
    write_atomically(path, lambda file: file.write(text.encode()))


class Lines:
    """The records in one file, by key, and their curves."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.curves = path.with_suffix(".curves.gz")

    def all(self) -> dict[str, dict[str, Any]]:
        """The values of each record by its key, without curves.

        They are shared by all callers: copy before you change them.
        """
        try:
            status = self.path.stat()
        except FileNotFoundError:
            return {}
        return _by_key(self.path, status.st_mtime_ns, status.st_size)

    def split(
        self, values: Mapping[str, Any], read: bool = True
    ) -> tuple[dict[str, Any], dict[str, Any]]:
        """The values of a record as they were put; its curves if they are `read`."""
        plain = {name: value for name, value in values.items() if name != AT}
        there = read and AT in values
        return plain, self._curves(*values[AT]) if there else {}

    def _curves(self, offset: int, length: int) -> dict[str, Any]:
        try:
            with open(self.curves, "rb") as file:
                file.seek(offset)
                return json.loads(gzip.decompress(file.read(length)))
        except (OSError, EOFError, ValueError) as error:
            place = f"{self.curves.name}, byte {offset}"
            raise Damaged(f"{place}: {first_line(error)}") from None

    def put(
        self, key: str, values: Mapping[str, Any], curves: Mapping[str, Any]
    ) -> None:
        """Store a record, in place of an earlier one of this key.

        Raises:
            ValueError: a number is not finite; nothing is stored.
        """
        with locked(self.path):
            known = self.all()
            packed = b""
            if curves:
                text = json.dumps(curves, allow_nan=False).encode()
                packed = gzip.compress(text, mtime=0)
                end = max((sum(v[AT]) for v in known.values() if AT in v), default=0)
                values = {**values, AT: [end, len(packed)]}
            line = line_of({"key": key, **values})
            if packed:
                _append(self.curves, packed, values[AT][0])
            if key in known:
                kept = [{"key": k, **v} for k, v in known.items() if k != key]
                write_lines(self.path, [*kept, {"key": key, **values}])
            else:
                content = self.path.read_bytes() if self.path.exists() else b""
                _append(self.path, line.encode(), content.rfind(b"\n") + 1)

    def drop(self, key: str) -> None:
        """Delete a record, if it is there."""
        with locked(self.path):
            known = self.all()
            if key in known:
                kept = [{"key": k, **v} for k, v in known.items() if k != key]
                write_lines(self.path, kept)


def _append(path: Path, content: bytes, end: int) -> None:
    """Write behind the first `end` bytes of a file; what was never finished goes."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with open(path, "r+b" if path.exists() else "xb") as file:
        file.truncate(end)
        file.seek(end)
        file.write(content)
        file.flush()
        os.fsync(file.fileno())


@functools.lru_cache(maxsize=32)
def _by_key(path: Path, *_: int) -> dict[str, dict[str, Any]]:
    lines = list(read_lines(path))
    if any("key" not in values for values in lines):
        raise Damaged("a line has no key")
    return {values.pop("key"): values for values in lines}
