"""The results store: one small JSON file a trial, written whole or not at all.

A row holds its trial, what came out, and what made it. Floats of the outcome carry 6 significant digits. Every file has
its checksum. Files of different trials have different names, so that one store takes in another.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from sidm.config import ConfigError, config, from_mapping
from sidm.experiments.engine.provenance import Provenance
from sidm.experiments.trials import Trial
from sidm.storage import Damaged, read_record, write_record

if TYPE_CHECKING:
    import pandas as pd

SCHEMA = 3  # of a row's file: 3 has the versions of its numbers
DIGITS = 6  # significant, of stored floats


class StoreError(OSError):
    """A row that cannot be read; the message is one line that names the file and the mend."""


@config
class Outcome:
    """What a trial yields: a pure function of the trial and its data. K rollout steps of 0.1 s, C curve points."""

    validation_loss: float  # equation (1) on the validation set, a sample, raw units of y
    component_losses: tuple[float, ...]  # (13,) its summands
    best_test_loss: float  # equation (1) on the novice test split, smoothed, of the weights that were kept
    position_error: tuple[float, ...]  # (K,) m, mean over the rollouts, after each step
    heading_error: tuple[float, ...]  # (K,) rad, mean over the rollouts, after each step
    example_predicted: tuple[tuple[float, float], ...]  # (K + 1, 2) m, x and y of the first rollout
    example_actual: tuple[tuple[float, float], ...]  # (K + 1, 2) m, where the robot really went
    curve_samples: tuple[int, ...]  # (C,) samples seen, of the learning curve's summary
    curve_test_loss: tuple[float, ...]  # (C,) test loss then
    curve_training_loss: tuple[float, ...]  # (C,) novice training loss then
    iterations: int  # of prediction, in all
    samples: int  # seen by prediction training, in all; without those of pretraining
    pretraining_samples: int = 0  # of the expert's, seen by the pretraining that the trial started from
    #: The loss by component at D points along the training, ever farther apart, on the first trajectories of each set;
    #: of older trials, of those of a bundle and of closed forms there are none.
    component_samples: tuple[int, ...] = ()  # (D,) samples seen
    component_test: tuple[tuple[float, ...], ...] = ()  # (D, 13) summands of equation (1)
    component_validation: tuple[tuple[float, ...], ...] = ()  # (D, 13)
    rollouts_predicted: tuple[tuple[tuple[float, ...], ...], ...] = ()  # (3, K + 1, 13) states of the first rollouts
    rollouts_actual: tuple[tuple[tuple[float, ...], ...], ...] = ()  # (3, K + 1, 13) where the robot really went


@config
class Row:
    """A line of the store."""

    trial: Trial
    outcome: Outcome
    provenance: Provenance


@config
class Failure:
    """What is kept of a trial that came to nothing: the loss that was not finite, and when."""

    trial: Trial
    what: str  # 'training' or 'test' loss
    loss: str  # 'nan' or 'inf'
    iteration: int  # of prediction
    provenance: Provenance

    def __str__(self) -> str:
        return f"{self.trial}: failed, the {self.what} loss was {self.loss} after {self.iteration} iterations"


def rounded(value: Any) -> Any:
    """`value` with every float in it rounded to DIGITS significant digits."""
    if isinstance(value, float):
        return float(f"{value:.{DIGITS}g}")
    if isinstance(value, (list, tuple)):
        return [rounded(item) for item in value]
    if isinstance(value, Mapping):
        return {name: rounded(item) for name, item in value.items()}
    return value


Stored = TypeVar("Stored", Row, Failure)


class Results:
    """The rows under a folder, by trial."""

    def __init__(self, folder: str | Path = "results") -> None:
        """`folder` need not exist."""
        self.folder = Path(folder)

    def path(self, trial: Trial) -> Path:
        """The file of a trial's row, whether it exists or not."""
        return self.folder / "trials" / f"{trial.key}.json"

    def failure_path(self, trial: Trial) -> Path:
        """The file that says how a trial failed, whether it exists or not."""
        return self.folder / "failures" / f"{trial.key}.json"

    def __contains__(self, trial: Trial) -> bool:
        """Whether a trial's row is stored."""
        return self.path(trial).is_file()

    def put(self, row: Row | Failure) -> Path:
        """Store a row, in place of an earlier one of the same trial and of its failure; or a failure.

        Raises:
            StoreError: the outcome is not finite (the training diverged).
        """
        path = self.path(row.trial) if isinstance(row, Row) else self.failure_path(row.trial)
        values = {"schema": SCHEMA, **rounded(dataclasses.asdict(row))}  # type: ignore[call-overload]
        values["trial"] = row.trial.to_json()
        try:
            write_record(path, values)
        except ValueError:
            raise StoreError(f"{row.trial}: the outcome is not finite; the training diverged") from None
        if isinstance(row, Row):
            self.failure_path(row.trial).unlink(missing_ok=True)
        return path

    def get(self, trial: Trial) -> Row | None:
        """A trial's row, or None where none is stored; StoreError when it is damaged or another trial's."""
        path = self.path(trial)
        if not path.is_file():
            return None
        return _of(trial, read_row(path), path)

    def failure(self, trial: Trial) -> Failure | None:
        """How a trial failed, or None where it did not; StoreError when the file is damaged or another trial's."""
        path = self.failure_path(trial)
        return _of(trial, _read(path, Failure), path) if path.is_file() else None

    def failures(self, trials: Iterable[Trial]) -> list[Failure]:
        """The failures among `trials` that today's code would repeat, in their order."""
        return [one for one in map(self.failure, trials) if one is not None and not one.provenance.stale]

    def rows(self, trials: Iterable[Trial]) -> list[Row]:
        """The stored rows among `trials`, in their order."""
        return [row for row in map(self.get, trials) if row is not None]

    def frame(self, trials: Iterable[Trial] | None = None) -> pd.DataFrame:
        """The stored rows among `trials`, all unless given, as a table: `frame.frame_of`."""
        from sidm.experiments.engine.frame import frame_of

        return frame_of(self.all() if trials is None else self.rows(trials))

    def missing(self, trials: Iterable[Trial]) -> list[Trial]:
        """Those of `trials` that are not stored, in their order."""
        return [trial for trial in trials if trial not in self]

    def stale(self, trials: Iterable[Trial]) -> list[Trial]:
        """Those of `trials` whose stored row was made by other code than today's."""
        return [row.trial for row in self.rows(trials) if row.provenance.stale]

    def all(self) -> list[Row]:
        """Every stored row, whatever its trial, in the order of the keys."""
        return [read_row(path) for path in sorted((self.folder / "trials").glob("*.json"))]

    def take_in(self, other: Results) -> int:
        """Copy what another store has and this one lacks: rows, failures, digests of datasets; how many rows came.

        Raises:
            StoreError: a row there is damaged.
        """
        came = 0
        for path in sorted((other.folder / "trials").glob("*.json")):
            row = read_row(path)
            if row.trial not in self:
                self.put(row)
                came += 1
        for name in ("failures", "datasets"):
            for path in (other.folder / name).rglob("*.json"):
                target = self.folder / path.relative_to(other.folder)
                if not target.exists() and not (name == "failures" and (self.folder / "trials" / path.name).exists()):
                    target.parent.mkdir(parents=True, exist_ok=True)
                    target.write_bytes(path.read_bytes())
        return came


def read_row(path: Path) -> Row:
    """The row in a file of the store; StoreError when it is damaged."""
    return _read(path, Row)


def _of(trial: Trial, row: Stored, path: Path) -> Stored:
    if row.trial != trial:
        raise StoreError(f"{path}: holds another trial; restore the file, or delete it and run the trial again")
    return row


def _read(path: Path, kind: type[Stored]) -> Stored:
    mend = "restore the file, or delete it and run the trial again"
    try:
        values = read_record(path)
        if (schema := values.pop("schema")) != SCHEMA:
            raise StoreError(f"{path}: has schema {schema}, this version reads {SCHEMA}; {mend}")
        return from_mapping(kind, values)
    except (KeyError, TypeError, AttributeError) as error:
        raise StoreError(f"{path}: not a row of results ({error!r}); {mend}") from None
    except (Damaged, ConfigError) as error:
        raise StoreError(f"{path}: damaged ({error}); {mend}") from None
