"""The phases of Algorithms 1 and 2, and the tests, for M trials at once.

Every trial has a `Trainer`, which draws batches, tracks the test loss and decides when
training ends, as in a single training. `StackedTrainers` computes for all M slots at
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
from companion.bundle.transfer import from_device, hand_over_losses, to_device
from sidm.learning.resuming import Checkpoint
from sidm.learning.stopping import CurvePoint
from sidm.settings import Network, Training

#: called after a test with the trial's number among the runs, and the test
Progress = Callable[[int, CurvePoint], None]
#: Trajectories that are tested at a time: of each trial, at most; of all trials
TESTED, TESTED_OF_ALL = 32, 2048


class Bundle:
    """M slots for trials that are trained together.

    Args:
        data: trajectories on the device, by system.
        network: sizes of the networks.
        training: settings; the trials share those that `training.SHARED` names.
        roles: the systems: ('novice', 'expert') or ('novice',).
        slots: M.
        device: where to compute.
    """

    def __init__(
        self,
        data: Mapping[str, DeviceData],
        network: Network,
        training: Training,
        roles: Sequence[str],
        slots: int,
        device: torch.device,
    ):
        self.data, self.network, self.training = data, network, training
        self.roles, self.device = roles, device
        self.stacked = StackedTrainers(data, network, training, roles, slots, device)
        self.slots: list[BundledTrial | None] = [None] * slots

    @property
    def trials(self) -> dict[int, BundledTrial]:
        """The trials of the bundle by slot; empty slots are left out."""
        return {i: trial for i, trial in enumerate(self.slots) if trial is not None}

    @property
    def running(self) -> dict[int, BundledTrial]:
        """The trials that have not ended, by slot."""
        return {slot: trial for slot, trial in self.trials.items() if not trial.ended}

    def join(self, trial: BundledTrial) -> None:
        """Put a trial into the first free slot."""
        slot = self.slots.index(None)
        self.slots[slot] = trial
        to_device(self.stacked, slot, trial.trainer)

    def leave(self, slot: int) -> BundledTrial:
        """Free a slot; its trial's trainer gets the state from the device."""
        trial = self.trials[slot]
        from_device(self.stacked, slot, trial.trainer)
        self.slots[slot] = None
        return trial

    def save(self) -> None:
        """Write the checkpoints of all trials that have a checkpoint folder."""
        for slot, trial in self.trials.items():
            if trial.run.checkpoint is not None:
                from_device(self.stacked, slot, trial.trainer)
                Checkpoint(trial.run.checkpoint).save(trial.trainer)

    def close(self) -> None:
        """Free what the device holds for the trials."""
        self.stacked.close()

    def shrunk(self) -> Bundle:
        """A bundle of the same trials without empty slots; it replaces this one."""
        trials = [self.leave(slot) for slot in self.trials]
        self.close()
        smaller = Bundle(
            self.data,
            self.network,
            self.training,
            self.roles,
            len(trials),
            self.device,
        )
        for trial in trials:
            smaller.join(trial)
        return smaller

    def phase(self, progress: Progress | None = None) -> None:
        """One phase of Algorithm 1 and one of Algorithm 2, for all trials."""
        self.prediction_phase(progress)
        for slot, trial in self.trials.items():
            # a trial that ended between two tests has at least one
            if trial.ended and not trial.error and not trial.trainer.history:
                self.take_tests([slot], progress)
        self.regularisation_phase()

    def timed_phase(self, progress: Progress | None = None) -> None:
        """Run `phase` and add an equal share of its time to every trial."""
        start, trials = time.monotonic(), list(self.trials.values())
        self.phase(progress)
        for trial in trials:
            trial.seconds += (time.monotonic() - start) / len(trials)

    def prediction_phase(self, progress: Progress | None = None) -> None:
        """A phase of Algorithm 1; trials that end within it stay as they are then."""
        running = self.running
        if not running:
            return
        iterations = self.training.prediction_iterations
        batches = {slot: t.draw_batches(iterations) for slot, t in running.items()}
        active = self._flags(running)
        rows = self._stack({slot: rows for slot, (rows, _) in batches.items()})
        of_expert = self._stack({slot: flags for slot, (_, flags) in batches.items()})
        experts = {slot: flags.sum(1).tolist() for slot, (_, flags) in batches.items()}
        for iteration in range(iterations):
            self.stacked.predict(active, rows[iteration], of_expert[iteration])
            for slot, trial in running.items():
                trial.count(experts[slot][iteration])
            due = [slot for slot, t in running.items() if t.trainer.test_is_due]
            self.take_tests(due, progress)
            if any(trial.ended for trial in running.values()):
                running = {slot: t for slot, t in running.items() if not t.ended}
                active = self._flags(running)
            if not running:
                return

    def regularisation_phase(self) -> None:
        """A phase of Algorithm 2, for the trials that are regularised."""
        training = self.training
        running = {
            slot: trial
            for slot, trial in self.running.items()
            if trial.trainer.training.regularise
        }
        if not running:
            return
        active = self._flags(running)

        def draw(iterations: int, role: str, count: int, purpose: str) -> Tensor:
            """Rows (iterations, M, count), on the device."""
            return self._stack(
                {
                    slot: trial.draw(iterations, role, count, purpose)
                    for slot, trial in running.items()
                }
            )

        iterations = training.discriminator_iterations
        count = training.discriminator_batch
        if training.discriminator_draw == "both":
            batches = [
                draw(iterations, role, count, f"discriminator {role}")
                for role in ("expert", "novice")
            ]
        else:
            drawn = {
                slot: trial.draw_single_system(iterations, count)
                for slot, trial in running.items()
            }
            batches = [
                self._stack({slot: batch[part] for slot, batch in drawn.items()})
                for part in (0, 1)  # rows, and whether they are the expert's
            ]
        for iteration in range(iterations):
            self.stacked.discriminate(active, *(part[iteration] for part in batches))
        iterations, count = training.matching_iterations, training.matching_batch
        rows = draw(iterations, "novice", count, "matching")
        self.stacked.matching_losses.zero_()
        for iteration in range(iterations):
            self.stacked.match(active, rows[iteration])
        if iterations:
            losses = (self.stacked.matching_losses / iterations).tolist()
            for slot, trial in running.items():
                trial.trainer.matching_loss = losses[slot]
        if training.discriminator_iterations:
            accuracy = self.stacked.accuracy.tolist()
            for slot, trial in running.items():
                trial.trainer.accuracy = accuracy[slot]

    def take_tests(
        self, slots: Sequence[int], progress: Progress | None = None
    ) -> None:
        """Measure the losses of the trials in these slots; keep the best weights."""
        if not slots:
            return
        trials = {slot: self.trials[slot] for slot in slots}
        test = self._mean_losses({slot: t.test_rows for slot, t in trials.items()})
        validation = self._mean_losses(
            {
                slot: trial.validation_rows
                for slot, trial in trials.items()
                if len(trial.validation_rows)
            }
        )
        best = []
        for slot, trial in trials.items():
            hand_over_losses(self.stacked, slot, trial.trainer)
            if trial.add_test(test[slot], validation.get(slot)):
                best.append(slot)
            if progress is not None and trial.error is None:
                progress(trial.number, trial.trainer.history[-1])
        self.stacked.keep_best(best)

    def _mean_losses(self, rows: Mapping[int, Tensor]) -> dict[int, Tensor]:
        """Means of equation (1) and of its summands over novice trajectories.

        Args:
            rows: (N,) each, the trajectories by slot; N may differ.

        Returns:
            (1 + Y,) float64 each, by slot.
        """
        if not rows:
            return {}
        size = min(TESTED, TESTED_OF_ALL // len(self.slots))
        size = max(size, self.training.batch)
        length = -(-max(map(len, rows.values())) // size) * size
        padded = torch.zeros(len(self.slots), length, dtype=torch.long)
        counted = torch.zeros(len(self.slots), length, dtype=torch.bool)
        for slot, trial_rows in rows.items():
            padded[slot, : len(trial_rows)] = trial_rows
            counted[slot, : len(trial_rows)] = True
        parts = zip(counted.split(size, dim=1), padded.split(size, dim=1), strict=True)
        sums = sum(
            self.stacked.test(flags.to(self.device), part.to(self.device)).cpu()
            for flags, part in parts
        )
        return {
            slot: sums[slot] / (len(trial_rows) * self.trials[slot].steps)
            for slot, trial_rows in rows.items()
        }

    def _flags(self, slots: Iterable[int]) -> Tensor:
        """(M,) bool on the device, True at `slots`."""
        flags = torch.zeros(len(self.slots), dtype=torch.bool)
        flags[list(slots)] = True
        return flags.to(self.device)

    def _stack(self, by_slot: Mapping[int, Tensor]) -> Tensor:
        """Tensors (I, b) by slot as one (I, M, b) on the device; 0 for other slots."""
        first = next(iter(by_slot.values()))
        stacked = first.new_zeros(len(first), len(self.slots), *first.shape[1:])
        for slot, tensor in by_slot.items():
            stacked[:, slot] = tensor
        return stacked.to(self.device)
