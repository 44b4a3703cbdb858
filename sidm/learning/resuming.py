"""A training that goes on where it was stopped: what a checkpoint keeps of a trainer, and when it is written."""

from __future__ import annotations

import dataclasses
import json
import math
import time
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from sidm.config import to_mapping
from sidm.learning import checkpoint
from sidm.learning.stopping import Components, EarlyStopping, Tested
from sidm.learning.trainer import Trainer
from sidm.settings import Network

#: share of the time that may go into writing; the first and the last phase are always
#: written
SAVING = 0.02
LONGEST = 60.0  # s without a checkpoint, however long one takes


class Checkpoint:
    """The checkpoint of one training.

    Args:
        folder: where it lies; None: the training keeps nothing.
    """

    def __init__(self, folder: str | Path | None) -> None:
        self.folder = None if folder is None else Path(folder)
        self._saved, self._cost = -math.inf, 0.0

    def restore(self, trainer: Trainer) -> bool:
        """Let a trainer go on from the checkpoint, bit for bit on one thread; False when there is none.

        Raises:
            CheckpointError: the checkpoint is damaged or of another run.
        """
        found = None if self.folder is None else checkpoint.read(self.folder)
        if found is None:
            return False
        tensors, values = found
        if values.get("run") != identity(trainer):
            raise checkpoint.CheckpointError(
                f"{self.folder}/{checkpoint.FILE}: the checkpoint is of another run; delete it or name another folder"
            )
        load_state(trainer, tensors, values)
        return True

    def save(self, trainer: Trainer) -> None:
        """Write a trainer's state, in place of the last."""
        if self.folder is not None:
            tensors, values = state(trainer)
            checkpoint.write(self.folder, tensors, {"run": identity(trainer)} | values)

    def save_when_due(self, trainer: Trainer) -> None:
        """Write a trainer's state at the end, and now and then before."""
        due = time.monotonic() - self._saved > min(self._cost / SAVING, LONGEST)
        if self.folder is not None and (trainer.finished or due):
            start = time.monotonic()
            self.save(trainer)
            self._saved = time.monotonic()
            self._cost = self._saved - start


def state(trainer: Trainer) -> tuple[dict[str, Tensor], dict[str, Any]]:
    """All that changes: tensors by path, and values of plain JSON types."""
    groups = {
        "model": checkpoint.module_tensors(trainer.model),
        "discriminator": checkpoint.module_tensors(trainer.discriminator),
        "best": trainer.best,
    }
    groups |= trainer.sampler.state()
    groups |= {
        name: checkpoint.optimiser_tensors(one)
        for name, one in trainer.optimisers().items()
    }
    groups |= {
        f"hook {number}": hook.tensors() for number, hook in enumerate(trainer.hooks)
    }
    tensors = {
        name: one
        for group, part in groups.items()
        for name, one in checkpoint.prefixed(group, part).items()
    }
    return tensors, {
        "stopping": dataclasses.asdict(trainer.stopping),
        "history": [list(tested) for tested in trainer.history],
        "components": trainer.components,
        "iteration": trainer.iteration,
        "samples": trainer.samples,
        "accuracy": trainer.accuracy,
        "losses": {role: list(pair) for role, pair in trainer.losses.items()},
    }


def load_state(
    trainer: Trainer, tensors: dict[str, Tensor], values: dict[str, Any]
) -> None:
    """Put back what `state` gave."""
    trainer.model.load_state_dict(checkpoint.under("model", tensors))
    trainer.discriminator.load_state_dict(checkpoint.under("discriminator", tensors))
    trainer.best = {
        name: tensor.to(trainer.device)
        for name, tensor in checkpoint.under("best", tensors).items()
    }
    for name, optimiser in trainer.optimisers().items():
        checkpoint.load_optimiser(optimiser, checkpoint.under(name, tensors))
    if trainer.training.zero_gradients:
        for parameter in trainer.prediction.state:  # which have had a gradient
            parameter.grad = torch.zeros_like(parameter)
    for number, hook in enumerate(trainer.hooks):
        hook.restore(checkpoint.under(f"hook {number}", tensors), values["iteration"])
    trainer.sampler.restore(
        checkpoint.under("generators", tensors), checkpoint.under("waiting", tensors)
    )
    trainer.stopping = EarlyStopping(**values["stopping"])
    trainer.history = [Tested(*tested) for tested in values["history"]]
    trainer.components = [
        Components(samples, tuple(t), tuple(v))
        for samples, t, v in values["components"]
    ]
    trainer.iteration, trainer.samples = values["iteration"], values["samples"]
    trainer.accuracy = values["accuracy"]
    trainer.losses = {
        role: (total, count) for role, (total, count) in values["losses"].items()
    }


def identity(trainer: Trainer) -> dict[str, Any]:
    """What makes this run another than the next: configuration, seed, units, initial weights, data."""
    datasets = trainer.datasets
    sets = {"train": datasets.train, "test": datasets.test, "expert": datasets.expert}
    return {
        "network": _plain(trainer.network),
        "training": dataclasses.asdict(trainer.training),  # type: ignore[call-overload]
        "seed": trainer.seed,
        "units": trainer.units,
        "start": trainer.start,
        "data": {
            k: checkpoint.digest((one.inputs, one.targets))
            for k, one in sets.items()
            if one is not None
        },
    }


def _plain(network: Network) -> dict[str, Any]:
    """A network's sizes as JSON gives them back, without bodies that are the paper's."""
    values = {
        name: value for name, value in to_mapping(network).items() if value is not None
    }
    return json.loads(json.dumps(values))
