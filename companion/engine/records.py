"""Stored results of studies: one file of JSON lines for each study.

A record says what it is about, what was measured, and how it was made. It is one line
of NAME.jsonl. Rows of trials are records, too (`store`); their curves are long and lie
in NAME.curves.gz, a member of gzip for each row, at the place that the line names.
"""

from __future__ import annotations

import functools
import gzip
import json
import sys
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Executor
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from companion.engine import known_motion
from companion.engine.datasets import digests_of
from companion.engine.frame import records_frame
from companion.engine.lines import append, line_of, read_lines, write_lines
from companion.engine.provenance import (
    THREADS,
    Provenance,
    are_stale,
    record_provenance,
    source,
)
from companion.trials import key_of, without_later
from sidm.config import (
    ConfigError,
    completed,
    first_line,
    from_mapping,
    to_mapping,
)
from sidm.pool import as_completed
from sidm.progress import progress_bar
from sidm.storage import Damaged, locked, read_record

if TYPE_CHECKING:
    import pandas as pd


#: A `config` class of records; its `about` is a `config` object, too.
F = TypeVar("F")

DIGITS = 6  # significant digits of stored floats
AT = "curves_at"  # field of a line: offset and length of its curves, bytes


class StoreError(OSError):
    """A record cannot be read or stored; one line names the file and what to do."""


def rounded(value: Any) -> Any:
    """`value` with every float in it rounded to DIGITS significant digits."""
    if isinstance(value, float):
        return float(f"{value:.{DIGITS}g}")
    if isinstance(value, (list, tuple)):
        return [rounded(item) for item in value]
    if isinstance(value, Mapping):
        return {name: rounded(item) for name, item in value.items()}
    return value


def by_field(parts: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Tuples of the parts' values, by name; all parts have the same names."""
    return {name: tuple(part[name] for part in parts) for name in parts[0]}


def records_of(kind: type[F], study: str) -> Callable[..., Records[F]]:
    """A function `records(results)` that gives a study's records of a kind."""
    name, command = study.replace("-", "_"), f"companion run --figure {study}"
    return lambda results="results": Records(kind, results, name, command)


def read_or_empty(path: Path) -> dict[str, Any]:
    """The values of a measurement's file; empty where it has none."""
    try:
        return read_record(path)
    except FileNotFoundError:
        return {}


class Records(Generic[F]):
    """The records of one kind under a folder.

    Args:
        kind: the class of the records.
        folder: of results; it need not exist.
        name: of the records' file, without its ending.
        command: makes the records; named in messages.
        subject: the field that says what a record is about.
        curves: fields of a record's `outcome` that are stored beside the lines.
    """

    def __init__(
        self,
        kind: type[F],
        folder: str | Path,
        name: str,
        command: str,
        subject: str = "about",
        curves: Sequence[str] = (),
    ) -> None:
        self.kind, self.folder, self.command = kind, Path(folder), command
        self.subject, self.curves = subject, curves
        self.path = self.folder / f"{name}.jsonl"
        self.curves_path = self.folder / f"{name}.curves.gz"

    def put(self, record: F) -> Path:
        """Store a record, in place of an earlier one about the same.

        Raises:
            StoreError: a number is not finite, or the file is damaged.
        """
        about = getattr(record, self.subject)
        values = rounded(to_mapping(record))
        values[self.subject] = without_later(to_mapping(about))
        curves = {name: values["outcome"].pop(name) for name in self.curves}
        curves = {name: curve for name, curve in curves.items() if curve}
        try:
            with locked(self.path):
                self._write({"key": key_of(about), **values}, curves)
        except Damaged as error:
            raise self._damaged(error) from None
        except ValueError:
            raise StoreError(
                f"{self.path}: {about}: not stored, a number is not finite"
            ) from None
        return self.path

    def _write(self, values: dict[str, Any], curves: Mapping[str, Any]) -> None:
        """Write a line after its curves; ValueError where a number is not finite."""
        known, packed, end = self._lines(), b"", 0
        if curves:
            text = json.dumps(curves, allow_nan=False).encode()
            packed = gzip.compress(text, mtime=0)
            end = max((sum(v[AT]) for v in known.values() if AT in v), default=0)
            values = {**values, AT: [end, len(packed)]}
        line = line_of(values).encode()
        if packed:
            append(self.curves_path, packed, end)
        if values["key"] in known:
            kept = [v for key, v in known.items() if key != values["key"]]
            write_lines(self.path, [*kept, values])
        else:
            content = self.path.read_bytes() if self.path.exists() else b""
            append(self.path, line, content.rfind(b"\n") + 1)

    def drop(self, about: Any) -> None:
        """Delete the record about something, if it is there."""
        with locked(self.path):
            key = key_of(about)
            if key in self.keys():
                lines = self._lines().items()
                write_lines(self.path, [line for k, line in lines if k != key])

    def _lines(self) -> dict[str, dict[str, Any]]:
        """The values of each line by its key; all callers share them."""
        try:
            status = self.path.stat()
        except FileNotFoundError:
            return {}
        return _by_key(self.path, status.st_mtime_ns, status.st_size)

    def keys(self) -> list[str]:
        """The keys of all records."""
        try:
            return [*self._lines()]
        except Damaged as error:
            raise self._damaged(error) from None

    def get(self, about: Any) -> F | None:
        """The stored record, or None."""
        record = self.of_key(key_of(about))
        if record is not None and getattr(record, self.subject) != about:
            raise self._damaged(f"'{about}' is about something else")
        return record

    def of_key(self, key: str) -> F | None:
        """The record of a key, or None."""
        return self._read(key, from_mapping, curves=True)

    def values(self, keys: Iterable[str], curves: bool = True) -> dict[str, dict]:
        """Plain values of the records of some keys, by key, see `config.completed`.

        Raises:
            OtherMotion: they were made with motion that differs by more than rounding.
        """
        found = {key: self._read(key, completed, curves) for key in keys}
        found = {key: values for key, values in found.items() if values is not None}
        seen = (values["provenance"]["digests"] for values in found.values())
        known_motion.refuse_mixed(seen, self.folder)
        return found

    def _read(self, key: str, read: Callable[[type, Any], Any], curves: bool) -> Any:
        """What `read` makes of the kind and the values of a line; None without it."""
        try:
            values = self._lines().get(key)
            if values is None:
                return None
            values = {n: v for n, v in values.items() if n != "key"}
            place = values.pop(AT, None)
            if self.curves:
                long = self._read_curves(*place) if curves and place else {}
                # curves of older versions that have no field any more are left out
                known = {name: long.get(name, ()) for name in self.curves}
                values["outcome"] = known | values["outcome"]
            return read(self.kind, values)
        except (Damaged, ConfigError, TypeError, KeyError) as error:
            raise self._damaged(error) from None

    def _read_curves(self, offset: int, length: int) -> dict[str, Any]:
        try:
            with open(self.curves_path, "rb") as file:
                file.seek(offset)
                return json.loads(gzip.decompress(file.read(length)))
        except (OSError, EOFError, ValueError) as error:
            place = f"{self.curves_path.name}, byte {offset}"
            raise Damaged(f"{place}: {first_line(error)}") from None

    def _damaged(self, error: object) -> StoreError:
        return StoreError(
            f"{self.path}: damaged ({error}); delete the line and run '{self.command}'"
        )

    def stored(self, abouts: Iterable[Any]) -> list[F]:
        """The stored records about `abouts`, in their order."""
        return [record for record in map(self.get, abouts) if record is not None]

    def missing(self, abouts: Iterable[Any]) -> list[Any]:
        """What has no record of today's versions of the numbers, in its order."""
        missing = []
        for about in abouts:
            values = self._read(key_of(about), completed, curves=False)
            if values is None or are_stale(values["provenance"]["numerics"]):
                missing.append(about)
        return missing

    def all(self) -> list[F]:
        """All stored records, in the order of their keys."""
        records = map(self.of_key, sorted(self.keys()))
        return [record for record in records if record is not None]

    def take_in(self, other: Records[F]) -> int:
        """Copy records, and what is known of their motion, from another store.

        What this store has stays as it is, but for records of older versions of the
        numbers: a record of today's versions takes their place.

        Returns:
            How many records were copied.
        """
        known_motion.take_in(other.folder, self.folder)
        copied = 0
        theirs: list[Any] = other.all()
        for record in theirs:
            known: Any = self.get(getattr(record, self.subject))
            stale = record.provenance.stale
            if known is None or (known.provenance.stale and not stale):
                self.put(record)
                copied += 1
        return copied

    def frame(self, abouts: Iterable[Any] | None = None) -> pd.DataFrame:
        """The stored records, all by default, as a table: `frame.records_frame`.

        Raises:
            OtherMotion: they were made with motion that differs by more than rounding.
        """
        keys = sorted(self.keys()) if abouts is None else map(key_of, abouts)
        return records_frame(self.kind, self.values(keys).values(), self.folder)

    def run(
        self,
        abouts: Sequence[Any],
        work: Callable[[Any], F],
        executor: Executor,
        what: str,
        progress: bool = True,
    ) -> int:
        """Make records, and store each as soon as it is done, in an older one's place.

        Returns:
            How many failed: each is reported in one line, and the others go on.
        """
        futures = [executor.submit(work, about) for about in abouts]
        failed = 0
        with progress_bar(len(abouts), what, what, progress) as bar:
            for done in as_completed(futures):
                try:
                    self.put(done.result())
                except Exception as error:  # one failure must not lose the others
                    message = f"companion: {what} failed: {one_line(error)}"
                    bar.write(message, file=sys.stderr)
                    failed += 1
                bar.update()
        return failed


@functools.lru_cache(maxsize=32)
def _by_key(path: Path, *_: int) -> dict[str, dict[str, Any]]:
    lines = list(read_lines(path))
    if any("key" not in values for values in lines):
        raise Damaged("a line has no key")
    return {values["key"]: values for values in lines}


def one_line(error: BaseException) -> str:
    """The first line of an error's message, after its type where that says more."""
    text = (str(error).splitlines() or [""])[0]
    plain = isinstance(error, (ValueError, OSError, ImportError)) and text
    return text if plain else f"{type(error).__name__}: {text}".rstrip(": ")


class ProvenanceTimer:
    """Measures the work on a record, for its provenance."""

    def __init__(self, kind: str, used: Any, data: str | Path) -> None:
        source()  # as the work begins
        self.kind, self.begun = kind, time.perf_counter()
        self.digests = digests_of(used, data) if used else {}

    def done(self) -> Provenance:
        """The provenance of the record; call it when the work is done."""
        seconds = time.perf_counter() - self.begun
        return record_provenance(seconds, THREADS, kind=self.kind, digests=self.digests)
