"""A trial of a bundle, as the host sees it: what it draws, how its test loss goes, when it is over."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import torch
from torch import Tensor

from companion.bundle.shelf import Shelf
from sidm.learning.dataset import Datasets
from sidm.learning.resuming import Checkpoint
from sidm.learning.stopping import Components, TrainingError
from sidm.learning.trainer import Trainer
from sidm.settings import Network, Training


class Run(NamedTuple):
    """What `train` takes, of one trial of a bundle."""

    datasets: Datasets
    training: Training
    seed: int
    checkpoint: Path | None = None  # a folder to go on from and to write to
    start: Mapping[str, Tensor] | None = None  # initial weights; fresh ones by default


class Seat:
    """A trial in the bundle: its trainer, where its data stand, what became of it."""

    def __init__(
        self, number: int, run: Run, network: Network, shelves: Mapping[str, Shelf]
    ):
        """Run `number` from its initial weights, or from its checkpoint."""
        self.number, self.run = number, run
        self.trainer = Trainer(
            run.datasets, network, run.training, run.seed, start=run.start
        )
        if run.checkpoint is not None:
            Checkpoint(run.checkpoint).restore(self.trainer)
        windows = self.trainer.sampler.windows
        self.places = {
            role: shelves[role].places(windows[role])
            for role in self.trainer.model.encoders
        }
        self.tests = shelves["novice"].places(run.datasets.test)[
            : len(self.trainer.test)
        ]
        self.watched = shelves["novice"].places(run.datasets.validation)[
            : len(self.trainer.validation)
        ]
        self.steps = shelves["novice"].steps
        self.error: TrainingError | None = None
        self.seconds = 0.0  # its share of the bundle's time

    @property
    def over(self) -> bool:
        """Whether it has ended, in one way or the other."""
        return self.error is not None or self.trainer.finished

    def draw_batches(self, iterations: int) -> tuple[Tensor, Tensor]:
        """Places on their system's shelf of batches' trajectories, and which are the expert's, each (iterations, b)."""
        places, of_expert = [], []
        for _ in range(iterations):
            for role, which in self.trainer.sampler.batch_indices().items():
                places.append(self.places[role][which])
                of_expert.append(torch.full((len(which),), role == "expert"))
        return tuple(
            torch.cat(pieces).unflatten(0, (iterations, -1))
            for pieces in (places, of_expert)
        )

    def draw(self, iterations: int, role: str, count: int, purpose: str) -> Tensor:
        """Places (iterations, count) of trajectories of one system."""
        drawn = [
            self.trainer.sampler.indices(role, count, purpose)
            for _ in range(iterations)
        ]
        return self.places[role][
            torch.stack(drawn) if drawn else torch.zeros(0, count, dtype=torch.long)
        ]

    def count(self, of_expert: Tensor) -> None:
        """Count an iteration of prediction on trajectories of which these (b,) are the expert's."""
        experts = int(of_expert.sum())
        samples = {
            "novice": (len(of_expert) - experts) * self.steps,
            "expert": experts * self.steps,
        }
        self.trainer.count(samples)

    def draw_discriminated(self, iterations: int, count: int) -> tuple[Tensor, Tensor]:
        """Places (iterations, count) of trajectories of one system at a time, and whether it is the expert."""
        places, of_expert = [torch.zeros(0, count, dtype=torch.long)], []
        for _ in range(iterations):
            (role,) = self.trainer.sampler.discriminated()
            places.append(self.draw(1, role, count, f"discriminator {role}"))
            of_expert.append(role == "expert")
        return torch.cat(places), torch.tensor(of_expert, dtype=torch.bool)

    def judge(self, test: Tensor, validation: Tensor | None) -> bool:
        """Take in a test, the loss and its summands (1 + Y,) of each set; whether the weights are the best so far.

        A loss that is not finite ends the trial.
        """
        total, *parts = test.tolist()
        watched = [] if validation is None else validation.tolist()
        try:
            better = self.trainer.add_test(total, watched[0] if watched else None)
        except TrainingError as error:
            self.error = error
            return False
        if watched and self.trainer.components_due:
            self.trainer.components.append(
                Components(self.trainer.samples, tuple(parts), tuple(watched[1:]))
            )
        return better
