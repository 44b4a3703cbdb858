"""The phases of Algorithms 1 and 2, and the tests, for M trials at once.

Every trial has a `Trainer`, which draws batches, tracks the test loss and decides when
training ends, as in a single training. `StackedTrainers` computes for all M trials at
once; b is the number of trajectories in a batch.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Mapping, Sequence

import torch
from torch import Tensor

from companion.bundle.bundled_trial import BundledTrial
from companion.bundle.device_data import DeviceData
from companion.bundle.trainers import StackedTrainers
from sidm.learning.checkpoint import Checkpoint
from sidm.learning.stopping import CurvePoint

#: called after a test with the trial's number among the runs, and the test
Progress = Callable[[int, CurvePoint], None]
#: Trajectories that are tested at a time: of each trial, at most; of all trials
TESTED, TESTED_OF_ALL = 32, 2048


class Bundle:
    """M trials that are trained together; ended ones stay as they were at their end."""

    def __init__(
        self, trials: Sequence[BundledTrial], data: DeviceData, device: torch.device
    ) -> None:
        self.trials, self.device = trials, device
        self.training = trials[0].trainer.training
        trainers = [trial.trainer for trial in trials]
        self.stacked = StackedTrainers(trainers, data, device)

    @property
    def running(self) -> dict[int, BundledTrial]:
        """The trials that have not ended, by their place in the bundle."""
        return {i: trial for i, trial in enumerate(self.trials) if not trial.ended}

    def hand_back(self, place: int) -> None:
        """Copy the state of the trial in this place to its trainer."""
        self.stacked.hand_back(place)

    def save(self) -> None:
        """Write the checkpoints of running trials that have a checkpoint folder."""
        for place, trial in self.running.items():
            if trial.run.checkpoint is not None:
                self.hand_back(place)
                Checkpoint(trial.run.checkpoint).save(trial.trainer)

    def close(self) -> None:
        """Free what the device holds for the trials."""
        self.stacked.close()

    def phase(self, progress: Progress | None = None) -> None:
        """One phase of Algorithm 1 and one of Algorithm 2, for all trials.

        Every running trial has an equal share of its time.
        """
        start, running = time.monotonic(), self.running
        self.prediction_phase(progress)
        for place, trial in running.items():
            # a trial that ended between two tests has at least one
            if trial.ended and not trial.error and not trial.trainer.history:
                self.take_tests([place], progress)
        self.regularisation_phase()
        for trial in running.values():
            trial.seconds += (time.monotonic() - start) / len(running)

    def prediction_phase(self, progress: Progress | None = None) -> None:
        """A phase of Algorithm 1; trials that end within it stay as they are then."""
        running = self.running
        if not running:
            return
        iterations = self.training.prediction_iterations
        drawn = {place: t.draw_batches(iterations) for place, t in running.items()}
        rows, of_expert = self._stack(drawn)
        experts = {place: flags.sum(1).tolist() for place, (_, flags) in drawn.items()}
        active = self._flags(running)
        for iteration in range(iterations):
            self.stacked.predict(active, rows[iteration], of_expert[iteration])
            for place, trial in running.items():
                trial.count(experts[place][iteration])
            due = [place for place, t in running.items() if t.trainer.test_is_due]
            self.take_tests(due, progress)
            if any(trial.ended for trial in running.values()):
                running = {place: t for place, t in running.items() if not t.ended}
                active = self._flags(running)
            if not running:
                return

    def regularisation_phase(self) -> None:
        """A phase of Algorithm 2, for the trials that are regularised."""
        training = self.training
        running = {
            place: trial
            for place, trial in self.running.items()
            if trial.trainer.training.regularise
        }
        if not running:
            return
        active = self._flags(running)
        if iterations := training.discriminator_iterations:
            rows, of_expert = self._stack(
                {
                    place: t.draw_discriminated(iterations)
                    for place, t in running.items()
                }
            )
            for iteration in range(iterations):
                self.stacked.discriminate(active, rows[iteration], of_expert[iteration])
            accuracy = self.stacked.accuracy.tolist()
            for place, trial in running.items():
                trial.trainer.accuracy = accuracy[place]
        if iterations := training.matching_iterations:
            settings = iterations, "novice", training.matching_batch, "matching"
            (rows,) = self._stack(
                {place: (t.draw(*settings),) for place, t in running.items()}
            )
            self.stacked.matching_losses.zero_()
            for iteration in range(iterations):
                self.stacked.match(active, rows[iteration])
            losses = (self.stacked.matching_losses / iterations).tolist()
            for place, trial in running.items():
                trial.trainer.matching_loss = losses[place]

    def take_tests(
        self, places: Sequence[int], progress: Progress | None = None
    ) -> None:
        """Measure the losses of the trials in these places; keep the best weights."""
        if not places:
            return
        trials = {place: self.trials[place] for place in places}
        test = self._mean_losses({i: t.test_rows for i, t in trials.items()})
        validation = self._mean_losses(
            {i: t.validation_rows for i, t in trials.items() if len(t.validation_rows)}
        )
        best = []
        for place, trial in trials.items():
            self.stacked.hand_over_losses(place)
            if trial.add_test(test[place], validation.get(place)):
                best.append(place)
            if progress is not None and trial.error is None:
                progress(trial.number, trial.trainer.history[-1])
        self.stacked.keep_best(best)

    def _mean_losses(self, rows: Mapping[int, Tensor]) -> dict[int, float]:
        """Means of equation (1) over novice trajectories, by place.

        Args:
            rows: (N,) each, the trajectories by place; N may differ.
        """
        if not rows:
            return {}
        count = len(self.trials)
        size = max(min(TESTED, TESTED_OF_ALL // count), self.training.batch)
        length = -(-max(map(len, rows.values())) // size) * size
        padded = torch.zeros(count, length, dtype=torch.long)
        counted = torch.zeros(count, length, dtype=torch.bool)
        for place, own in rows.items():
            padded[place, : len(own)] = own
            counted[place, : len(own)] = True
        parts = zip(counted.split(size, dim=1), padded.split(size, dim=1), strict=True)
        sums = sum(
            self.stacked.test(flags.to(self.device), part.to(self.device)).cpu()
            for flags, part in parts
        )
        steps = self.trials[0].steps
        means = {i: sums[i] / (len(own) * steps) for i, own in rows.items()}
        return {place: float(mean) for place, mean in means.items()}

    def _flags(self, places: Iterable[int]) -> Tensor:
        """(M,) bool on the device, True at `places`."""
        flags = torch.zeros(len(self.trials), dtype=torch.bool)
        flags[list(places)] = True
        return flags.to(self.device)

    def _stack(self, by_place: Mapping[int, Sequence[Tensor]]) -> list[Tensor]:
        """Tensors (I, b) by place as (I, M, b) on the device; 0 for other places."""
        stacked = []
        for tensors in zip(*by_place.values(), strict=True):
            shape = len(tensors[0]), len(self.trials), *tensors[0].shape[1:]
            whole = tensors[0].new_zeros(shape)
            whole[:, list(by_place)] = torch.stack(tensors, dim=1)
            stacked.append(whole.to(self.device))
        return stacked
