"""What studies find that are no trials of the store: a file each, by what it is about, with its provenance."""

from __future__ import annotations

import dataclasses
import sys
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Executor, as_completed
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from companion.engine.datasets import others
from companion.engine.provenance import THREADS, Provenance, here, source
from companion.trials import LATER as LATER_OF_TRIALS
from companion.trials import key_of_values
from sidm.config import ConfigError, from_mapping
from sidm.progress import progress_bar
from sidm.storage import Damaged, read_record, write_record

if TYPE_CHECKING:
    import pandas as pd


#: a `config` class with its `about`, a `config` object too, and its `provenance`
F = TypeVar("F")

DIGITS = 6  # significant, of stored floats

#: Values that older records do not have, where they are as they were then; `fit` they
#: had from the first.
LATER = tuple(one for one in LATER_OF_TRIALS if one[0] != "fit")


class StoreError(OSError):
    """A record that cannot be read, or not be stored; the message is one line that names the file and the mend."""


def key_of(about: Any) -> str:
    """20 hexadecimal digits that change when any value of a `config` object does."""
    return key_of_values(
        dataclasses.asdict(
            about,
            dict_factory=lambda pairs: {k: v for k, v in pairs if (k, v) not in LATER},
        )
    )


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
    """Fields of a record that have an entry a part, from those of each part."""
    return {name: tuple(one[name] for one in parts) for name in parts[0]}


def records_of(kind: type[F], study: str) -> Callable[..., Records[F]]:
    """A study's `records(results)`: where its results of a kind are kept, under the folder of all results."""
    place = study.replace("-", "_")
    return lambda results="results": Records(
        kind, Path(results) / place, f"companion run --figure {study}"
    )


def single(path: Path) -> dict[str, Any]:
    """What the one record of a study holds; empty where it has none."""
    try:
        return read_record(path)
    except FileNotFoundError:
        return {}


class Records(Generic[F]):
    """The records of one kind under a folder.

    Args:
        kind: their class.
        folder: of their files; it need not exist.
        again: the command that makes them, for messages.
    """

    subject = "about"  # the field that says what a record is about
    place = ""  # of the files within the folder

    def __init__(self, kind: type[F], folder: str | Path, again: str) -> None:
        self.kind, self.folder, self.again = kind, Path(folder), again

    def path(self, about: Any) -> Path:
        """The file of a record, whether it exists or not."""
        return self.folder / self.place / f"{key_of(about)}.json"

    def _values(self, found: Any) -> dict[str, Any]:
        """What is written of a record: its numbers rounded, those of what it is about not."""
        return rounded(dataclasses.asdict(found)) | {
            "about": dataclasses.asdict(found.about)
        }

    def put(self, found: F) -> Path:
        """Store a record, in place of an earlier one of the same.

        Raises:
            StoreError: a number is not finite.
        """
        path = self.path(getattr(found, self.subject))
        try:
            write_record(path, self._values(found))
        except ValueError:
            raise StoreError(f"{path}: not stored, a number is not finite") from None
        return path

    def get(self, about: Any) -> F | None:
        """The stored record, None where there is none; StoreError when it is damaged or about something else."""
        path = self.path(about)
        try:
            found = self._read(path)
        except FileNotFoundError:
            return None
        if getattr(found, self.subject) != about:
            raise StoreError(
                f"{path}: is about something else; delete it and run '{self.again}'"
            )
        return found

    def _read(self, path: Path) -> F:
        try:
            return from_mapping(self.kind, self._readable(read_record(path)))
        except (Damaged, ConfigError, TypeError) as error:
            raise StoreError(
                f"{path}: damaged ({error}); delete it and run '{self.again}'"
            ) from None

    def _readable(self, values: dict[str, Any]) -> dict[str, Any]:
        """The fields of a record from what a file holds; Damaged for another version's."""
        return values

    def stored(self, abouts: Iterable[Any]) -> list[F]:
        """The stored ones, in their order."""
        return [found for found in map(self.get, abouts) if found is not None]

    def all(self) -> list[F]:
        """Every stored one, whatever it is about, in the order of the keys."""
        return [
            self._read(path)
            for path in sorted((self.folder / self.place).glob("*.json"))
        ]

    def frame(self, abouts: Iterable[Any] | None = None) -> pd.DataFrame:
        """The stored ones, all unless given, as a table: `frame.records_frame`."""
        from companion.engine.frame import records_frame

        return records_frame(
            self.kind, self.all() if abouts is None else self.stored(abouts)
        )

    def run(
        self,
        abouts: Sequence[Any],
        work: Callable[[Any], F],
        executor: Executor,
        what: str,
        progress: bool = True,
    ) -> int:
        """Do the `work` of those that are not stored, and store each as soon as it is done; `what` is for the bar.

        Returns:
            How many failed: they are reported in one line each, and the others go on.
        """
        missing = [about for about in abouts if self.get(about) is None]
        futures = [executor.submit(work, about) for about in missing]
        failed = 0
        with progress_bar(len(missing), what, what, progress) as bar:
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
    """An error for a person: the first line of its message, after its type where that says more."""
    text = (str(error).splitlines() or [""])[0]
    plain = isinstance(error, (ValueError, OSError, ImportError)) and text
    return text if plain else f"{type(error).__name__}: {text}".rstrip(": ")


class Making:
    """What a record says of how it was made.

    Args:
        kind: of work, one of `numerics.NUMERICS`.
        used: what names its `datasets` and their `digests`, as a Trial does; None where
            there are none.
        data: their folder.
    """

    def __init__(self, kind: str, used: Any, data: str | Path) -> None:
        source()  # as the work begins
        self.kind, self.begun = kind, time.perf_counter()
        self.others = others(used, data) if used else ()

    def done(self) -> Provenance:
        """The provenance of a record."""
        made = here(time.perf_counter() - self.begun, THREADS, kind=self.kind)
        return dataclasses.replace(made, other_data=self.others)  # type: ignore[type-var]
