"""Checkpoints of a training, from which it continues where it was stopped."""

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
from sidm.learning.stopping import Components, CurvePoint, EarlyStopping
from sidm.learning.trainer import Trainer
from sidm.settings import Network

#: share of the time that may go into writing checkpoints; one is always written after
#: the first and after the last phase
MAX_WRITING_SHARE = 0.02
MAX_INTERVAL = 60.0  # s between two checkpoints, however long it takes to write one


class Checkpoint:
    """The checkpoint of one training in a folder; of None nothing is written."""

    def __init__(self, folder: str | Path | None) -> None:
        self.folder = None if folder is None else Path(folder)
        self._last_time, self._cost = -math.inf, 0.0  # s

    def restore(self, trainer: Trainer) -> bool:
        """Put a trainer into the state of the checkpoint, and say whether there is one.

        On one thread the training continues bit for bit.
        """
        stored = None if self.folder is None else checkpoint.read(self.folder)
        if stored is None:
            return False
        tensors, values = stored
        if values.get("run") != identity(trainer):
            raise checkpoint.CheckpointError(
                f"{self.folder}/{checkpoint.FILE}: the checkpoint is of another run; "
                "delete it or name another folder"
            )
        load_state(trainer, tensors, values)
        return True

    def save(self, trainer: Trainer) -> None:
        """Write a trainer's state; it replaces the previous one."""
        if self.folder is not None:
            tensors, values = state(trainer)
            checkpoint.write(self.folder, tensors, {"run": identity(trainer)} | values)

    def save_when_due(self, trainer: Trainer) -> None:
        """Write a trainer's state at the end, and at intervals before the end."""
        interval = min(self._cost / MAX_WRITING_SHARE, MAX_INTERVAL)
        due = time.monotonic() - self._last_time > interval
        if self.folder is not None and (trainer.finished or due):
            start = time.monotonic()
            self.save(trainer)
            self._last_time = time.monotonic()
            self._cost = self._last_time - start


def state(trainer: Trainer) -> tuple[dict[str, Tensor], dict[str, Any]]:
    """Tensors by path, and plain JSON values, of all that changes during training."""
    groups = {
        "model": checkpoint.module_tensors(trainer.model),
        "discriminator": checkpoint.module_tensors(trainer.discriminator),
        "best": trainer.best_weights,
    }
    groups |= trainer.sampler.state()
    for name, optimiser in trainer.optimisers().items():
        groups[name] = checkpoint.optimiser_tensors(optimiser)
    for number, hook in enumerate(trainer.hooks):
        groups[f"hook {number}"] = hook.tensors()
    tensors = {
        f"{group}/{name}": tensor
        for group, members in groups.items()
        for name, tensor in members.items()
    }
    return tensors, {
        "stopping": dataclasses.asdict(trainer.stopping),
        "history": [list(point) for point in trainer.history],
        "components": trainer.components,
        "iteration": trainer.iteration,
        "samples": trainer.samples,
        "accuracy": trainer.accuracy,
        "matching_loss": trainer.matching_loss,
        "losses": {role: list(pair) for role, pair in trainer.losses.items()},
    }


def load_state(
    trainer: Trainer, tensors: dict[str, Tensor], values: dict[str, Any]
) -> None:
    """Put a trainer into the state that `state` gave."""

    def group(name: str) -> dict[str, Tensor]:
        start = f"{name}/"
        return {
            n.removeprefix(start): t
            for n, t in tensors.items()
            if n[: len(start)] == start
        }

    trainer.model.load_state_dict(group("model"))
    trainer.discriminator.load_state_dict(group("discriminator"))
    trainer.best_weights = {
        name: tensor.to(trainer.device) for name, tensor in group("best").items()
    }
    for name, optimiser in trainer.optimisers().items():
        checkpoint.load_optimiser(optimiser, group(name))
    if trainer.training.zero_gradients:
        # those that have had a gradient
        for parameter in trainer.prediction_optimiser.state:
            parameter.grad = torch.zeros_like(parameter)
    for number, hook in enumerate(trainer.hooks):
        hook.restore(group(f"hook {number}"), values["iteration"])
    trainer.sampler.restore(group("generators"), group("waiting"))
    trainer.stopping = EarlyStopping(**values["stopping"])
    trainer.history = [CurvePoint(*point) for point in values["history"]]
    trainer.components = [
        Components(samples, tuple(test), tuple(validation))
        for samples, test, validation in values["components"]
    ]
    trainer.iteration, trainer.samples = values["iteration"], values["samples"]
    trainer.accuracy = values["accuracy"]
    trainer.matching_loss = values.get("matching_loss")  # older ones lack it
    trainer.losses = {
        role: (total, count) for role, (total, count) in values["losses"].items()
    }


def identity(trainer: Trainer) -> dict[str, Any]:
    """All that distinguishes one run from another, as plain JSON values.

    These are configuration, seed, units, initial weights and data.
    """
    datasets = trainer.datasets
    sets = {"train": datasets.train, "test": datasets.test, "expert": datasets.expert}
    return {
        "network": _plain(trainer.network),
        "training": dataclasses.asdict(trainer.training),  # type: ignore[call-overload]
        "seed": trainer.seed,
        "units": trainer.units_digest,
        "start": trainer.start_digest,
        "data": {
            name: checkpoint.digest((windows.inputs, windows.targets))
            for name, windows in sets.items()
            if windows is not None
        },
    }


def _plain(network: Network) -> dict[str, Any]:
    """A network's fields as JSON gives them back; those that are None are left out.

    A body that is None is the paper's.
    """
    values = {
        name: value for name, value in to_mapping(network).items() if value is not None
    }
    return json.loads(json.dumps(values))
