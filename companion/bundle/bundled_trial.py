"""One trial of a bundle, as the host sees it: its trainer, its draws, its end."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import torch
from torch import Tensor

from companion.bundle.device_data import DeviceData
from sidm.learning.checkpoint import Checkpoint
from sidm.learning.dataset import Datasets
from sidm.learning.stopping import TrainingError
from sidm.learning.trainer import Trainer
from sidm.settings import Network, Training
from sidm.systems import ROLES


class Run(NamedTuple):
    """The arguments that `train` takes, for one trial of a bundle."""

    datasets: Datasets
    training: Training
    seed: int
    checkpoint: Path | None = None  # folder to resume from and to write to
    start: Mapping[str, Tensor] | None = None  # initial weights; None: fresh ones


class BundledTrial:
    """A trial of a bundle: its trainer, the rows of its data, its outcome.

    Args:
        number: of the trial among the runs of the bundle.
        run: its data and settings. It starts from its checkpoint where there is one.
        network: sizes of the networks.
        data: trajectories on the device.
    """

    def __init__(
        self, number: int, run: Run, network: Network, data: DeviceData
    ) -> None:
        self.number, self.run = number, run
        self.trainer = Trainer(
            run.datasets, network, run.training, run.seed, start=run.start
        )
        if run.checkpoint is not None:
            Checkpoint(run.checkpoint).restore(self.trainer)
        trainer, self.steps = self.trainer, data.steps
        windows = trainer.sampler.windows
        self.rows = {role: data.rows(windows[role]) for role in trainer.model.encoders}
        self.test_rows = data.rows(run.datasets.test)[: len(trainer.test)]
        validation_rows = data.rows(run.datasets.validation)
        self.validation_rows = validation_rows[: len(trainer.validation)]
        self.error: TrainingError | None = None
        self.seconds = 0.0  # this trial's share of the bundle's time

    @property
    def ended(self) -> bool:
        """Whether training has ended, by its stopping rule or by an error."""
        return self.error is not None or self.trainer.finished

    def draw_batches(self, iterations: int) -> tuple[Tensor, Tensor]:
        """Batches of Algorithm 1.

        Returns:
            Rows of the trajectories in their system's data, and which of them are the
            expert's: (iterations, b) int64 and bool.
        """
        indices, of_expert = self.trainer.sampler.batches(iterations)
        rows = torch.empty_like(indices)
        for role, own in zip(ROLES, (~of_expert, of_expert), strict=True):
            if role in self.rows:
                rows[own] = self.rows[role][indices[own]]
        return rows, of_expert

    def draw(self, iterations: int, role: str, count: int, purpose: str) -> Tensor:
        """Rows (iterations, count) of random trajectories of one system."""
        drawn = self.trainer.sampler.indices(role, iterations * count, purpose)
        return self.rows[role][drawn].unflatten(0, (iterations, count))

    def draw_discriminated(self, iterations: int) -> tuple[Tensor, Tensor]:
        """Batches of the discriminator: of both systems, or of one drawn at random.

        Returns:
            Rows of the trajectories, and which of them are the expert's:
            (iterations, b) int64 and bool.
        """
        training = self.trainer.training
        count = training.discriminator_batch
        if training.discriminator_draw == "both":
            halves = [
                self.draw(iterations, role, count, f"discriminator {role}")
                for role in ("expert", "novice")
            ]
            flags = torch.arange(2 * count) < count
            return torch.cat(halves, dim=1), flags.expand(iterations, -1)
        of_expert = self.trainer.sampler.discriminated_systems(iterations)
        rows = torch.zeros(iterations, count, dtype=torch.long)
        for role, own in zip(ROLES, (~of_expert, of_expert), strict=True):
            rows[own] = self.draw(int(own.sum()), role, count, f"discriminator {role}")
        return rows, of_expert[:, None].expand(-1, count)

    def count(self, experts: int) -> None:
        """Count one iteration of prediction in the trainer."""
        novices = self.trainer.training.batch - experts
        samples = {"novice": novices * self.steps, "expert": experts * self.steps}
        self.trainer.count_samples(samples)

    def add_test(self, test: float, validation: float | None) -> bool:
        """Add a test to the learning curve; a loss that is not finite ends the trial.

        Args:
            test: mean of equation (1) on the test split.
            validation: the same on the validation set; None without one.

        Returns:
            Whether the current weights are the best so far.
        """
        try:
            return self.trainer.add_test(test, validation)
        except TrainingError as error:
            self.error = error
            return False
