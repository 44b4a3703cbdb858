"""The results store: a line for each trial, written whole or not at all.

Floats of the outcome carry 6 significant digits.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from companion.engine.frame import table_of
from companion.engine.records import Records
from companion.engine.rows import CURVES, Failure, Row
from companion.trials import Trial

if TYPE_CHECKING:
    import pandas as pd


class Results(Records[Row]):
    """The rows under a folder of results, by trial, and the failures.

    The folder need not exist.
    """

    def __init__(self, folder: str | Path = "results") -> None:
        where = folder, "trials", "companion run", "trial", CURVES
        super().__init__(Row, *where)
        self.failed = Records(Failure, folder, "failures", "companion run", "trial")

    def put(self, record: Row | Failure) -> Path:
        """Store a row or a failure, in place of an earlier one of the same trial.

        Raises:
            StoreError: a number is not finite (the training diverged).
        """
        if isinstance(record, Failure):
            return self.failed.put(record)
        path = super().put(record)
        self.failed.drop(record.trial)
        return path

    def failures(self, trials: Iterable[Trial]) -> list[Failure]:
        """The failures of `trials` that today's code would repeat, in their order."""
        failures = self.failed.stored(trials)
        return [failure for failure in failures if not failure.provenance.stale]

    def frame(
        self, trials: Iterable[Trial] | None = None, curves: bool = False
    ) -> pd.DataFrame:
        """Stored rows as a table, see `frame.table_of`.

        Args:
            trials: whose rows; by default all.
            curves: whether with the columns CURVES, which are long.

        Raises:
            OtherMotion: they were made with motion that differs by more than rounding.
        """
        keys = self.keys() if trials is None else [trial.key for trial in trials]
        rows = self.values(keys, curves)
        return table_of(rows.items(), self.folder, curves)

    def take_in(self, other: Results) -> int:  # type: ignore[override]
        """Copy failures too, of trials that have no row here."""
        copied = super().take_in(other)
        for failure in other.failed.all():
            if self.get(failure.trial) is None and not self.failed.get(failure.trial):
                self.failed.put(failure)
        return copied
