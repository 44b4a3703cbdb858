"""What studies find that are no trials of the store: a file each, by what it is about, with its provenance."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import sys
import time
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import Executor, as_completed
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, Protocol, TypeVar

from sidm.config import ConfigError, from_mapping
from sidm.experiments.engine.datasets import Uses, others
from sidm.experiments.engine.provenance import THREADS, Provenance, here
from sidm.experiments.engine.run import one_line
from sidm.experiments.engine.store import StoreError, rounded
from sidm.progress import progress_bar
from sidm.storage import Damaged, read_record, write_record

if TYPE_CHECKING:
    import pandas as pd


class Found(Protocol):
    """A `config` class of what was found."""

    @property
    def about(self) -> Any:
        """What it is about, a `config` object that holds everything it depends on."""

    @property
    def provenance(self) -> Provenance:
        """What made it."""


F = TypeVar("F", bound=Found)


#: Values of what records are about that older ones do not have, where they are as they were then.
LATER = (("motion", "figures"), ("novice_body", None), ("expert_body", None), ("pretrained", "all"))


def key_of(about: Any) -> str:
    """20 hexadecimal digits that change when any value of a `config` object does."""
    values = dataclasses.asdict(about, dict_factory=lambda pairs: {k: v for k, v in pairs if (k, v) not in LATER})
    text = json.dumps(values, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()[:20]


class Records(Generic[F]):
    """The records of one kind under a folder.

    Args:
        kind: their class.
        folder: of their files; it need not exist.
        again: the command that makes them, for messages.
    """

    def __init__(self, kind: type[F], folder: str | Path, again: str) -> None:
        self.kind, self.folder, self.again = kind, Path(folder), again

    def path(self, about: Any) -> Path:
        """The file of a record, whether it exists or not."""
        return self.folder / f"{key_of(about)}.json"

    def put(self, found: F) -> None:
        """Store a record; its numbers are rounded as in the store of trials, what it is about is not.

        Raises:
            StoreError: a number is not finite.
        """
        values = rounded(dataclasses.asdict(found))  # type: ignore[call-overload]
        try:
            write_record(self.path(found.about), values | {"about": dataclasses.asdict(found.about)})
        except ValueError:
            raise StoreError(f"{self.path(found.about)}: not stored, a number is not finite") from None

    def get(self, about: Any) -> F | None:
        """The stored record, None where there is none; StoreError when it is damaged or about something else."""
        path = self.path(about)
        try:
            found = self._read(path)
        except FileNotFoundError:
            return None
        if found.about != about:
            raise StoreError(f"{path}: is about something else; delete it and run '{self.again}'")
        return found

    def _read(self, path: Path) -> F:
        try:
            return from_mapping(self.kind, read_record(path))
        except (Damaged, ConfigError, TypeError) as error:
            raise StoreError(f"{path}: damaged ({error}); delete it and run '{self.again}'") from None

    def stored(self, abouts: Iterable[Any]) -> list[F]:
        """The stored ones, in their order."""
        return [found for found in map(self.get, abouts) if found is not None]

    def all(self) -> list[F]:
        """Every stored one, whatever it is about, in the order of the keys."""
        return [self._read(path) for path in sorted(self.folder.glob("*.json"))]

    def frame(self, abouts: Iterable[Any] | None = None) -> pd.DataFrame:
        """The stored ones, all unless given, as a table: `frame.records_frame`."""
        from sidm.experiments.engine.frame import records_frame

        return records_frame(self.kind, self.all() if abouts is None else self.stored(abouts))

    def run(
        self, abouts: Sequence[Any], work: Callable[[Any], F], executor: Executor, what: str, progress: bool = True
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
                    bar.write(f"sidm: {what} failed: {one_line(error)}", file=sys.stderr)
                    failed += 1
                bar.update()
        return failed


class Making:
    """What a record says of how it was made.

    Args:
        kind: of work, one of `numerics.NUMERICS`.
        used: what names the data that it is made from; None where none are.
        data: their folder.
    """

    def __init__(self, kind: str, used: Uses | None, data: str | Path) -> None:
        self.kind, self.begun = kind, time.perf_counter()
        self.others = others(used, data) if used else ()

    def done(self) -> Provenance:
        """The provenance of a record."""
        made = here(time.perf_counter() - self.begun, THREADS, kind=self.kind)
        return dataclasses.replace(made, other_data=self.others)  # type: ignore[type-var]
