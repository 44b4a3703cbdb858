"""Stored results of studies: one file of JSON lines for each study.

A record says what it is about, what was measured, and how it was made. The rows of
trials are records, too (`store`).
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Executor
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from companion.engine.datasets import digests_of
from companion.engine.frame import records_frame
from companion.engine.known_motion import refuse_mixed
from companion.engine.lines import Lines
from companion.engine.provenance import THREADS, Provenance, here, source
from companion.trials import key_of_values, without_later
from sidm.config import ConfigError, from_mapping, to_mapping
from sidm.pool import as_completed
from sidm.progress import progress_bar
from sidm.storage import Damaged, read_record

if TYPE_CHECKING:
    import pandas as pd


#: A `config` class of records; its `about` is a `config` object, too.
F = TypeVar("F")

DIGITS = 6  # significant digits of stored floats


class StoreError(OSError):
    """A record cannot be read or stored; one line names the file and what to do."""


def key_of(about: Any) -> str:
    """20 hexadecimal digits that change when any value of a `config` object does."""
    return key_of_values(without_later(to_mapping(about)))


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
    name = study.replace("-", "_")
    return lambda results="results": Records(
        kind, Path(results), name, f"companion run --figure {study}"
    )


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
    """

    subject = "about"  # the field that says what a record is about

    def __init__(
        self, kind: type[F], folder: str | Path, name: str, command: str
    ) -> None:
        self.kind, self.folder, self.command = kind, Path(folder), command
        self.lines = Lines(self.folder / f"{name}.jsonl")

    def _split(self, values: dict[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
        """What stands in the line of a record, and its curves."""
        return values, {}

    def _joined(self, values: dict[str, Any], curves: dict[str, Any]) -> dict[str, Any]:
        """The values of a record from its line and its curves."""
        return values

    def put(self, record: F) -> Path:
        """Store a record, in place of an earlier one about the same.

        Raises:
            StoreError: a number is not finite, or the file is damaged.
        """
        about = getattr(record, self.subject)
        values = rounded(to_mapping(record))
        values[self.subject] = without_later(to_mapping(about))
        try:
            self.lines.put(key_of(about), *self._split(values))
        except Damaged as error:
            raise self._damaged(error) from None
        except ValueError:
            raise StoreError(
                f"{self.lines.path}: {about}: not stored, a number is not finite"
            ) from None
        return self.lines.path

    def get(self, about: Any) -> F | None:
        """The stored record, or None."""
        values = self._values().get(key_of(about))
        if values is None:
            return None
        record = self._read(values)
        if getattr(record, self.subject) != about:
            raise self._damaged(f"'{about}' is about something else")
        return record

    def _values(self) -> dict[str, dict[str, Any]]:
        try:
            return self.lines.all()
        except Damaged as error:
            raise self._damaged(error) from None

    def _read(self, values: dict[str, Any], curves: bool = True) -> F:
        try:
            values = self._joined(*self.lines.split(values, curves))
            return from_mapping(self.kind, values)
        except (Damaged, ConfigError, TypeError, KeyError) as error:
            raise self._damaged(error) from None

    def _damaged(self, error: object) -> StoreError:
        return StoreError(
            f"{self.lines.path}: damaged ({error}); delete the line and run "
            f"'{self.command}'"
        )

    def stored(self, abouts: Iterable[Any]) -> list[F]:
        """The stored records about `abouts`, in their order."""
        records = map(self.get, abouts)
        return [record for record in records if record is not None]

    def is_current(self, about: Any) -> bool:
        """Whether a record of today's versions of the numbers is stored."""
        values = self._values().get(key_of(about))
        record: Any = values and self._read(values, curves=False)
        return record is not None and not record.provenance.stale

    def missing(self, abouts: Iterable[Any]) -> list[Any]:
        """What has no record of today's versions of the numbers, in its order."""
        return [about for about in abouts if not self.is_current(about)]

    def all(self) -> list[F]:
        """All stored records, in the order of their keys."""
        return [self._read(values) for _, values in sorted(self._values().items())]

    def frame(self, abouts: Iterable[Any] | None = None) -> pd.DataFrame:
        """The stored records, all by default, as a table: `frame.records_frame`.

        Raises:
            OtherMotion: they were made with motion that differs by more than rounding.
        """
        records = self.all() if abouts is None else self.stored(abouts)
        self.refuse_mixed(records)
        return records_frame(self.kind, records, self.folder)

    def refuse_mixed(self, records: Iterable[Any]) -> None:
        """Refuse records made with motion that differs by more than rounding."""
        refuse_mixed((record.provenance.digests for record in records), self.folder)

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
                    bar.write(
                        f"companion: {what} failed: {one_line(error)}", file=sys.stderr
                    )
                    failed += 1
                bar.update()
        return failed


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
        return here(seconds, THREADS, kind=self.kind, digests=self.digests)
