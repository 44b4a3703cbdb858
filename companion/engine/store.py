"""The results store: a line for each trial, written whole or not at all.

A row holds its trial, what came out, and what made it. Floats of the outcome carry 6
significant digits.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from companion.engine import known_motion
from companion.engine.provenance import Provenance
from companion.engine.records import Records
from companion.trials import Trial
from sidm.config import config

if TYPE_CHECKING:
    import pandas as pd


@config
class Outcome:
    """What a trial yields, a function of the trial and its data alone.

    The loss is that of equation (1), in raw units of y unless the robot's body asks for
    other ones. K is the number of steps of a rollout, 0.1 s each. E tests of the
    training are stored, one after each `test_spacing` samples; trials of older versions
    have none. The loss by component is stored at D of them, ever farther apart; trials
    of older versions, older trials of a bundle and closed forms have none.

    Attributes:
        validation_loss: loss of a sample of the validation set
        component_losses: (Y,) summands of the validation loss
        best_test_loss: smoothed loss on the novice's test split, of the weights kept
        position_error: (K,) m, mean over the rollouts, after each step
        heading_error: (K,) rad, mean over the rollouts, after each step
        example_predicted: (K + 1, 2) m, predicted x and y of the first rollout
        example_actual: (K + 1, 2) m, simulated x and y of the first rollout
        curve_samples: (C,) samples seen at the C points of the learning curve's summary
        curve_test_loss: (C,) test loss at these points
        curve_training_loss: (C,) novice's training loss at these points
        iterations: prediction iterations in all
        samples: samples seen in prediction phases, those of a pretraining left out
        pretraining_samples: samples of the expert seen in the pretraining
        test_spacing: samples between two tests
        every_training_loss: (E,) loss on the novice's samples since the previous
            test
        every_test_loss: (E,) loss on the first trajectories of the novice's test split,
            not smoothed
        every_validation_loss: (E,) loss on the first trajectories of the validation set
        every_discriminator_accuracy: (E,) share of latents that the discriminator
            classified correctly in its last iteration; None before its first
        every_matching_loss: (E,) mean of equation (4) over the last matching; None
            before the first
        component_samples: (D,) samples seen at the tests with losses by component
        component_test: (D, Y) summands of the test loss
        component_validation: (D, Y) summands of the validation loss
        rollouts_predicted: (3, K + 1, 13) predicted states of the first rollouts
        rollouts_actual: (3, K + 1, 13) simulated states of the first rollouts
    """

    validation_loss: float
    component_losses: tuple[float, ...]
    best_test_loss: float
    position_error: tuple[float, ...]
    heading_error: tuple[float, ...]
    example_predicted: tuple[tuple[float, float], ...]
    example_actual: tuple[tuple[float, float], ...]
    curve_samples: tuple[int, ...]
    curve_test_loss: tuple[float, ...]
    curve_training_loss: tuple[float, ...]
    iterations: int
    samples: int
    pretraining_samples: int = 0
    test_spacing: int = 0
    every_training_loss: tuple[float, ...] = ()
    every_test_loss: tuple[float, ...] = ()
    every_validation_loss: tuple[float, ...] = ()
    every_discriminator_accuracy: tuple[float | None, ...] = ()
    every_matching_loss: tuple[float | None, ...] = ()
    component_samples: tuple[int, ...] = ()
    component_test: tuple[tuple[float, ...], ...] = ()
    component_validation: tuple[tuple[float, ...], ...] = ()
    rollouts_predicted: tuple[tuple[tuple[float, ...], ...], ...] = ()
    rollouts_actual: tuple[tuple[tuple[float, ...], ...], ...] = ()


@config
class Row:
    """A stored trial with its outcome."""

    trial: Trial
    outcome: Outcome
    provenance: Provenance


@config
class Failure:
    """A stored trial whose training failed because a loss was not finite."""

    trial: Trial
    what: str  # the loss: 'training' or 'test'
    loss: str  # its value: 'nan' or 'inf'
    iteration: int  # prediction iterations until then
    provenance: Provenance

    def __str__(self) -> str:
        reason = f"the {self.what} loss was {self.loss}"
        return f"{self.trial}: failed, {reason} after {self.iteration} iterations"


#: Fields of an outcome that are long: they are stored beside the lines.
CURVES = (
    "example_predicted",
    "example_actual",
    "curve_samples",
    "curve_test_loss",
    "curve_training_loss",
    "every_training_loss",
    "every_test_loss",
    "every_validation_loss",
    "every_discriminator_accuracy",
    "every_matching_loss",
    "component_samples",
    "component_test",
    "component_validation",
    "rollouts_predicted",
    "rollouts_actual",
)


class Failures(Records[Failure]):
    """The failures under a folder of results."""

    subject = "trial"


class Results(Records[Row]):
    """The rows under a folder of results, by trial, and the failures.

    Args:
        folder: of the results; it need not exist.
    """

    subject = "trial"

    def __init__(self, folder: str | Path = "results") -> None:
        super().__init__(Row, folder, "trials", "companion run")
        self.failed = Failures(Failure, folder, "failures", "companion run")

    def _split(self, values: dict[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
        outcome = values["outcome"]
        curves = {name: outcome[name] for name in CURVES if outcome[name]}
        short = {k: v for k, v in outcome.items() if k not in CURVES}
        return {**values, "outcome": short}, curves

    def _joined(self, values: dict[str, Any], curves: dict[str, Any]) -> dict[str, Any]:
        empty = dict.fromkeys(CURVES, ())
        return {**values, "outcome": empty | values["outcome"] | curves}

    def put(self, record: Row | Failure) -> Path:
        """Store a row or a failure, in place of an earlier one of the same trial.

        Raises:
            StoreError: a number is not finite (the training diverged).
        """
        if isinstance(record, Failure):
            return self.failed.put(record)
        path = super().put(record)
        self.failed.lines.drop(record.trial.key)
        return path

    def rows(self, trials: Iterable[Trial]) -> list[Row]:
        """The stored rows of `trials`, in their order."""
        return self.stored(trials)

    def failures(self, trials: Iterable[Trial]) -> list[Failure]:
        """The failures of `trials` that today's code would repeat, in their order."""
        failures = self.failed.stored(trials)
        return [failure for failure in failures if not failure.provenance.stale]

    def frame(
        self, trials: Iterable[Trial] | None = None, curves: bool = False
    ) -> pd.DataFrame:
        """Stored rows as a table, see `frame.frame_of`.

        Args:
            trials: whose rows; by default all.
            curves: whether with the columns CURVES, which are long.

        Raises:
            OtherMotion: they were made with motion that differs by more than rounding.
        """
        from companion.engine.frame import frame_of

        values = self._values()
        keys = values if trials is None else (trial.key for trial in trials)
        rows = [self._read(values[key], curves) for key in keys if key in values]
        self.refuse_mixed(rows)
        return frame_of(rows, self.folder, curves)

    def take_in(self, other: Results) -> int:
        """Copy rows, failures and what is known of motion from another store.

        What this store has stays as it is, but for rows of older versions of the
        numbers: a row of today's versions takes their place.

        Returns:
            How many rows were copied.

        Raises:
            OtherMotion: the rows there were made with other motion.
            StoreError: a row there is damaged.
        """
        known_motion.take_in(other.folder, self.folder)
        copied = 0
        for row in other.all():
            known = self.get(row.trial)
            if known is None or (known.provenance.stale and not row.provenance.stale):
                self.put(row)
                copied += 1
        for failure in other.failed.all():
            if self.get(failure.trial) is None and not self.failed.get(failure.trial):
                self.failed.put(failure)
        return copied
