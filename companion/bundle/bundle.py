"""M trials in their seats: the phases of Algorithms 1 and 2, and their tests.

Each trial keeps its `Trainer`, which draws its batches, follows its test loss and says
when it is over, as in a training of its own; `StackedLearners` do the arithmetic of
all. M seats, b trajectories in a batch.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Mapping, Sequence

import torch
from torch import Tensor

from companion.bundle.learners import StackedLearners
from companion.bundle.seat import Seat
from companion.bundle.shelf import Shelf
from sidm.learning.resuming import Checkpoint
from sidm.learning.stopping import Tested
from sidm.settings import Network, Training


class Bundle:
    """Seats for M trials."""

    def __init__(
        self,
        shelves: Mapping[str, Shelf],
        network: Network,
        training: Training,
        roles: Sequence[str],
        seats: int,
        device: torch.device,
    ):
        self.shelves, self.network, self.training, self.roles, self.device = (
            shelves,
            network,
            training,
            roles,
            device,
        )
        self.stacked = StackedLearners(shelves, network, training, roles, seats, device)
        self.seats: list[Seat | None] = [None] * seats

    @property
    def taken(self) -> dict[int, Seat]:
        """The trials that are here, by seat."""
        return {
            index: seat for index, seat in enumerate(self.seats) if seat is not None
        }

    def join(self, seat: Seat) -> None:
        """Seat a trial in the first free place."""
        index = self.seats.index(None)
        self.seats[index] = seat
        self.stacked.put(index, seat.trainer)

    def leave(self, index: int) -> Seat:
        """Give a trial's trainer what it has learnt, and free its place."""
        seat = self.taken[index]
        self.stacked.get(index, seat.trainer)
        self.seats[index] = None
        return seat

    def save(self) -> None:
        """Write the checkpoints of all trials that have a folder for it."""
        for index, seat in self.taken.items():
            if seat.run.checkpoint is not None:
                self.stacked.get(index, seat.trainer)
                Checkpoint(seat.run.checkpoint).save(seat.trainer)

    def close(self) -> None:
        """Free what the device holds for the trials that are here."""
        self.stacked.close()

    def shrunk(self) -> Bundle:
        """A bundle of the same trials without empty seats, in place of this one."""
        seats = [self.leave(index) for index in self.taken]
        self.close()
        small = Bundle(
            self.shelves,
            self.network,
            self.training,
            self.roles,
            len(seats),
            self.device,
        )
        for seat in seats:
            small.join(seat)
        return small

    def phase(self, progress: Callable[[int, Tested], None] | None = None) -> None:
        """A phase of Algorithm 1 and one of Algorithm 2 of all trials."""
        self.predict_phase(progress)
        for index, seat in self.taken.items():
            if seat.over and not seat.error and not seat.trainer.history:
                self.take_tests([index], progress)
        self.regularise_phase()

    def timed_phase(
        self, progress: Callable[[int, Tested], None] | None = None
    ) -> None:
        """A phase whose time is shared out among those who took part."""
        start, here = time.monotonic(), list(self.taken.values())
        self.phase(progress)
        for seat in here:
            seat.seconds += (time.monotonic() - start) / len(here)

    def predict_phase(
        self, progress: Callable[[int, Tested], None] | None = None
    ) -> None:
        """Algorithm 1."""
        going = {index: seat for index, seat in self.taken.items() if not seat.over}
        if not going:
            return
        batches = {
            index: seat.draw_batches(self.training.prediction_iterations)
            for index, seat in going.items()
        }
        moving = self._flags(going)
        places = self._spread({index: places for index, (places, _) in batches.items()})
        of_expert = self._spread({index: who for index, (_, who) in batches.items()})
        for iteration in range(self.training.prediction_iterations):
            self.stacked.predict(moving, places[iteration], of_expert[iteration])
            for index, seat in going.items():
                seat.count(batches[index][1][iteration])
            due = [
                index
                for index, seat in going.items()
                if seat.trainer.iteration % self.training.test_interval == 0
            ]
            self.take_tests(due, progress)
            if any(seat.over for seat in going.values()):
                going = {index: seat for index, seat in going.items() if not seat.over}
                moving = self._flags(going)
            if not going:
                return

    def regularise_phase(self) -> None:
        """Algorithm 2, of the trials that have one."""
        training = self.training
        going = {
            i: seat
            for i, seat in self.taken.items()
            if seat.trainer.training.regularise and not seat.over
        }
        if not going:
            return
        moving = self._flags(going)

        def drawn(iterations: int, role: str, count: int, purpose: str) -> Tensor:
            """Places (iterations, M, count) on the device."""
            return self._spread(
                {
                    i: seat.draw(iterations, role, count, purpose)
                    for i, seat in going.items()
                }
            )

        count, batch = training.discriminator_iterations, training.discriminator_batch
        if training.discriminator_draw == "both":
            batches = [
                drawn(count, role, batch, f"discriminator {role}")
                for role in ("expert", "novice")
            ]
        else:
            drawn_one = {
                index: seat.draw_discriminated(count, batch)
                for index, seat in going.items()
            }
            batches = [
                self._spread({index: one[part] for index, one in drawn_one.items()})
                for part in (0, 1)
            ]
        for iteration in range(count):
            self.stacked.discriminate(moving, *(part[iteration] for part in batches))
        matched = drawn(
            training.matching_iterations, "novice", training.matching_batch, "matching"
        )
        for iteration in range(training.matching_iterations):
            self.stacked.match(moving, matched[iteration])
        if count:
            right = self.stacked.right.tolist()
            for index, seat in going.items():
                seat.trainer.accuracy = right[index]

    def take_tests(
        self,
        indices: Sequence[int],
        progress: Callable[[int, Tested], None] | None = None,
    ) -> None:
        """Measure the test losses of these seats' trials; keep the weights of those that are the best so far."""
        if not indices:
            return
        better, tests = [], {index: self.taken[index].tests for index in indices}
        watched = {
            index: places
            for index in indices
            if len(places := self.taken[index].watched)
        }
        test, validation = (
            self._component_losses(tests),
            self._component_losses(watched),
        )
        for index in indices:
            seat = self.taken[index]
            self.stacked.settle(index, seat.trainer)
            if seat.judge(test[index], validation.get(index)):
                better.append(index)
            if progress is not None and seat.error is None:
                progress(seat.number, seat.trainer.history[-1])
        self.stacked.keep_best(better)

    def _component_losses(self, sets: Mapping[int, Tensor]) -> dict[int, Tensor]:
        """The mean of equation (1) and of its summands, (1 + Y,) float64, over trajectories at places (N,), by seat."""
        if not sets:
            return {}
        size = self.training.batch  # at a time: what has room in training has room here
        length = -(-max(map(len, sets.values())) // size) * size
        places = torch.zeros(len(self.seats), length, dtype=torch.long)
        counted = torch.zeros(len(self.seats), length, dtype=torch.bool)
        for index, mine in sets.items():
            places[index, : len(mine)], counted[index, : len(mine)] = mine, True
        parts = zip(counted.split(size, dim=1), places.split(size, dim=1), strict=True)
        sums = sum(
            self.stacked.test(some.to(self.device), at.to(self.device)).cpu()
            for some, at in parts
        )
        return {
            index: sums[index] / (len(mine) * self.taken[index].steps)
            for index, mine in sets.items()
        }

    def _flags(self, indices: Iterable[int]) -> Tensor:
        """(M,) bool, on the device: True at `indices`."""
        flags = torch.zeros(len(self.seats), dtype=torch.bool)
        flags[list(indices)] = True
        return flags.to(self.device)

    def _spread(self, of_seats: Mapping[int, Tensor]) -> Tensor:
        """(I, M, b) on the device of (I, b) by seat; 0 at the seats that have none."""
        first = next(iter(of_seats.values()))
        spread = first.new_zeros(len(first), len(self.seats), *first.shape[1:])
        for index, mine in of_seats.items():
            spread[:, index] = mine
        return spread.to(self.device)
