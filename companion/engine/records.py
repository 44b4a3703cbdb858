"""Stored results of studies: one JSON file for each record.

A record says what it is about, what was measured, and how it was made. The rows of
trials are records, too (`store`).
"""

from __future__ import annotations

import dataclasses
import sys
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Executor
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from companion.engine.datasets import substitute_digests
from companion.engine.provenance import THREADS, Provenance, here, source
from companion.trials import LATER as LATER_OF_TRIALS
from companion.trials import key_of_values
from sidm.config import ConfigError, from_mapping
from sidm.pool import as_completed
from sidm.progress import progress_bar
from sidm.storage import Damaged, read_record, write_record

if TYPE_CHECKING:
    import pandas as pd


#: A `config` class of records; its `about` is a `config` object, too.
F = TypeVar("F")

DIGITS = 6  # significant digits of stored floats

#: Fields with values that older records lack; `key_of` leaves them out. Records have
#: had `fit` from the first.
LATER = tuple(pair for pair in LATER_OF_TRIALS if pair[0] != "fit")


class StoreError(OSError):
    """A record cannot be read or stored; one line names the file and what to do."""


def key_of(about: Any) -> str:
    """20 hexadecimal digits that change when any value of a `config` object does."""

    def without_later(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        return {name: value for name, value in pairs if (name, value) not in LATER}

    return key_of_values(dataclasses.asdict(about, dict_factory=without_later))


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
    place = study.replace("-", "_")
    return lambda results="results": Records(
        kind, Path(results) / place, f"companion run --figure {study}"
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
        folder: of the records' files; it need not exist.
        command: makes the records; named in messages.
    """

    subject = "about"  # the field that says what a record is about
    place = ""  # of the files within the folder

    def __init__(self, kind: type[F], folder: str | Path, command: str) -> None:
        self.kind, self.folder, self.command = kind, Path(folder), command

    def path(self, about: Any) -> Path:
        """The file of a record, whether it exists or not."""
        return self.folder / self.place / f"{key_of(about)}.json"

    def _values(self, record: Any) -> dict[str, Any]:
        """The values that are written: floats are rounded except those of `about`."""
        return rounded(dataclasses.asdict(record)) | {
            "about": dataclasses.asdict(record.about)
        }

    def put(self, record: F) -> Path:
        """Store a record, in place of an earlier one about the same.

        Raises:
            StoreError: a number is not finite.
        """
        path = self.path(getattr(record, self.subject))
        try:
            write_record(path, self._values(record))
        except ValueError:
            raise StoreError(f"{path}: not stored, a number is not finite") from None
        return path

    def get(self, about: Any) -> F | None:
        """The stored record, or None.

        Raises:
            StoreError: the file is damaged or about something else.
        """
        path = self.path(about)
        try:
            record = self._read(path)
        except FileNotFoundError:
            return None
        if getattr(record, self.subject) != about:
            raise StoreError(
                f"{path}: is about something else; delete it and run '{self.command}'"
            )
        return record

    def _read(self, path: Path) -> F:
        try:
            return from_mapping(self.kind, self._readable(read_record(path)))
        except (Damaged, ConfigError, TypeError) as error:
            raise StoreError(
                f"{path}: damaged ({error}); delete it and run '{self.command}'"
            ) from None

    def _readable(self, values: dict[str, Any]) -> dict[str, Any]:
        """The fields of a record among a file's values; Damaged for other versions."""
        return values

    def stored(self, abouts: Iterable[Any]) -> list[F]:
        """The stored records about `abouts`, in their order."""
        records = map(self.get, abouts)
        return [record for record in records if record is not None]

    def is_current(self, about: Any) -> bool:
        """Whether a record of today's versions of the numbers is stored."""
        record: Any = self.get(about)
        return record is not None and not record.provenance.stale

    def missing(self, abouts: Iterable[Any]) -> list[Any]:
        """What has no record of today's versions of the numbers, in its order."""
        return [about for about in abouts if not self.is_current(about)]

    def all(self) -> list[F]:
        """All stored records, in the order of their keys."""
        paths = sorted((self.folder / self.place).glob("*.json"))
        return [self._read(path) for path in paths]

    def frame(self, abouts: Iterable[Any] | None = None) -> pd.DataFrame:
        """The stored records, all by default, as a table: `frame.records_frame`."""
        from companion.engine.frame import records_frame

        records = self.all() if abouts is None else self.stored(abouts)
        return records_frame(self.kind, records)

    def run(
        self,
        abouts: Sequence[Any],
        work: Callable[[Any], F],
        executor: Executor,
        what: str,
        progress: bool = True,
    ) -> int:
        """Make records, and store each as soon as it is done, in an older one's place.

        Args:
            abouts: what the records are about; see `missing`.
            work: makes the record about one of them.
            executor: where the work is done.
            what: the name of the work, for the bar and for messages.
            progress: whether to show a bar.

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
    """Measures the work on a record, for its provenance.

    Args:
        kind: of work, one of `numerics.NUMERICS`.
        used: an object with `datasets` and their `digests`, such as a Trial; None where
            no dataset is used.
        data: the folder of the datasets.
    """

    def __init__(self, kind: str, used: Any, data: str | Path) -> None:
        source()  # as the work begins
        self.kind, self.begun = kind, time.perf_counter()
        self.substitute_digests = substitute_digests(used, data) if used else ()

    def done(self) -> Provenance:
        """The provenance of the record; call it when the work is done."""
        made = here(time.perf_counter() - self.begun, THREADS, kind=self.kind)
        return dataclasses.replace(made, other_data=self.substitute_digests)  # type: ignore[type-var]
