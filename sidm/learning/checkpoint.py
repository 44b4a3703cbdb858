"""Checkpoints: arrays and one JSON text in an .npz file with a checksum.

An array's name is its path in a run's state: 'model/sidm.lstm.weight_ih_l0',
'prediction/12/exp_avg'. A training continues from its checkpoint where it was stopped.
"""

from __future__ import annotations

import dataclasses
import json
import math
import time
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import torch
from torch import Tensor

from sidm.config import DataError, to_mapping
from sidm.learning.stopping import CurvePoint, EarlyStopping
from sidm.storage import checksum, read_arrays, write_arrays

if TYPE_CHECKING:
    from sidm.learning.dataset import Windows
    from sidm.learning.trainer import Trainer

FILE = "checkpoint.npz"
TEXT = "json"  # the name of the array that holds the text

#: share of the time that may go into writing checkpoints; one is always written after
#: the first and after the last phase
MAX_WRITING_SHARE = 0.02
MAPS_COMPARED = 16  # windows of each robot whose maps must be those of the checkpoint
MAX_INTERVAL = 60.0  # s between two checkpoints, however long it takes to write one


class CheckpointError(DataError):
    """A checkpoint that is damaged or of another run; one line with a remedy."""


class Checkpoint:
    """The checkpoint of one training in a folder; of None nothing is written."""

    def __init__(self, folder: str | Path | None) -> None:
        self.folder = None if folder is None else Path(folder)
        self._last_time, self._cost = -math.inf, 0.0  # s
        self._run: dict[str, Any] | None = None  # its identity, known once

    def _identity(self, trainer: Trainer) -> dict[str, Any]:
        if self._run is None:
            self._run = _identity(trainer)
        return self._run

    def restore(self, trainer: Trainer) -> bool:
        """Put a trainer into the state of the checkpoint, and say whether there is one.

        On one thread the training continues bit for bit.
        """
        stored = None if self.folder is None else read(self.folder)
        if stored is None:
            return False
        tensors, values = stored
        if values.get("run") != self._identity(trainer):
            raise CheckpointError(
                f"{self.folder}/{FILE}: the checkpoint is of another run; "
                "delete it or name another folder"
            )
        _load_state(trainer, tensors, values)
        return True

    def save(self, trainer: Trainer) -> None:
        """Write a trainer's state; it replaces the previous one."""
        if self.folder is not None:
            tensors, values = _state(trainer)
            write(self.folder, tensors, {"run": self._identity(trainer)} | values)

    def save_when_due(self, trainer: Trainer) -> None:
        """Write a trainer's state at the end, and at intervals before the end."""
        start = time.monotonic()
        interval = min(self._cost / MAX_WRITING_SHARE, MAX_INTERVAL)
        if trainer.finished or start - self._last_time > interval:
            self.save(trainer)
            self._last_time = time.monotonic()
            self._cost = self._last_time - start


def write(
    folder: Path, tensors: Mapping[str, Tensor], values: Mapping[str, Any]
) -> None:
    """Write tensors and values of plain JSON types as the checkpoint of `folder`."""
    arrays = {name: tensor.detach().cpu().numpy() for name, tensor in tensors.items()}
    arrays[TEXT] = np.frombuffer(json.dumps(values).encode(), np.uint8)
    write_arrays(Path(folder) / FILE, arrays)


def read(folder: Path) -> tuple[dict[str, Tensor], dict[str, Any]] | None:
    """The tensors and values that `write` was given; None without a checkpoint."""
    path = Path(folder) / FILE
    try:
        arrays = read_arrays(path)
        values = json.loads(arrays.pop(TEXT).tobytes())
    except FileNotFoundError:
        return None
    except (ValueError, KeyError) as error:
        raise CheckpointError(
            f"{path}: the checkpoint is damaged ({error}); delete it to start afresh"
        ) from None
    return {name: torch.from_numpy(array) for name, array in arrays.items()}, values


def digest(tensors: Iterable[Tensor]) -> str:
    """A checksum of tensors of one type, joined in their order."""
    return checksum(torch.cat([tensor.flatten() for tensor in tensors]).cpu().numpy())


def _state(trainer: Trainer) -> tuple[dict[str, Tensor], dict[str, Any]]:
    """Tensors by path, and plain JSON values, of all that changes during training."""
    groups: dict[str, Mapping[str, Tensor]] = {
        "model": trainer.model.state_dict(),
        "discriminator": trainer.discriminator.state_dict(),
        "best": trainer.best_weights,
    }
    groups |= trainer.sampler.state()
    for name, optimiser in trainer.optimisers().items():
        # moments have the shapes of their parameters, step counts are scalars ()
        groups[name] = {
            f"{number}/{key}": tensor
            for number, entry in optimiser.state_dict()["state"].items()
            for key, tensor in entry.items()
        }
    groups["added"] = trainer.added_tensors()
    tensors = {
        f"{group}/{name}": tensor
        for group, members in groups.items()
        for name, tensor in members.items()
    }
    names = "history", "iteration", "samples", "accuracy"
    values = {name: getattr(trainer, name) for name in (*names, "matching_loss")}
    stopping = dataclasses.asdict(trainer.stopping)
    return tensors, values | {"stopping": stopping, "losses": trainer.losses}


def _load_state(
    trainer: Trainer, tensors: dict[str, Tensor], values: dict[str, Any]
) -> None:
    """Put a trainer into the state that `_state` gave."""

    def group(name: str) -> dict[str, Tensor]:
        start = f"{name}/"
        return {n[len(start) :]: t for n, t in tensors.items() if n.startswith(start)}

    trainer.model.load_state_dict(group("model"))
    trainer.discriminator.load_state_dict(group("discriminator"))
    trainer.best_weights = {
        name: tensor.to(trainer.device) for name, tensor in group("best").items()
    }
    for name, optimiser in trainer.optimisers().items():
        _load_optimiser(optimiser, group(name))
    if trainer.training.zero_gradients:
        # those that have had a gradient
        for parameter in trainer.prediction_optimiser.state:
            parameter.grad = torch.zeros_like(parameter)
    trainer.restore_added(group("added"))
    trainer.sampler.restore(group("generators"), group("waiting"))
    trainer.stopping = EarlyStopping(**values["stopping"])
    trainer.history = [CurvePoint(*point) for point in values["history"]]
    trainer.iteration, trainer.samples = values["iteration"], values["samples"]
    trainer.accuracy = values["accuracy"]
    trainer.matching_loss = values.get("matching_loss")  # older ones lack it
    trainer.losses = {role: (t, count) for role, (t, count) in values["losses"].items()}


def _load_optimiser(
    optimiser: torch.optim.Optimizer, tensors: Mapping[str, Tensor]
) -> None:
    """Load an optimiser's tensors by 'parameter number/name'."""
    groups = optimiser.param_groups
    parameters = [parameter for group in groups for parameter in group["params"]]
    state: dict[int, dict[str, Tensor]] = {}
    for path, tensor in tensors.items():
        number, name = path.split("/")
        # fused kernels read moments and weights in memory order: both need one layout
        if tensor.ndim:
            tensor = torch.empty_like(parameters[int(number)]).copy_(tensor)
        state.setdefault(int(number), {})[name] = tensor
    settings = optimiser.state_dict()["param_groups"]
    optimiser.load_state_dict({"state": state, "param_groups": settings})


def _data_identity(windows: Windows) -> list[Any]:
    """Shape of the windows, and checksums of their numbers and of some of their maps.

    All maps of the expert are a gigabyte.
    """
    even = np.linspace(0, len(windows) - 1, min(len(windows), MAPS_COMPARED))
    some = windows.take(even.round().astype(int))
    numbers = digest((windows.inputs, windows.targets))
    return [list(windows.inputs.shape), numbers, digest((some.maps,))]


def _identity(trainer: Trainer) -> dict[str, Any]:
    """Configuration, seed, units, initial weights and data of a run, as JSON values."""
    datasets = trainer.datasets
    sets = {"train": datasets.train, "test": datasets.test, "expert": datasets.expert}
    sets |= {"validation": trainer.validation}
    # without what is None: a body that is None is the paper's
    sizes = {n: v for n, v in to_mapping(trainer.network).items() if v is not None}
    return {
        "network": json.loads(json.dumps(sizes)),
        "training": to_mapping(trainer.training),
        "seed": trainer.seed,
        "units": trainer.units_digest,
        "start": trainer.start_digest,
        "data": {
            name: _data_identity(windows)
            for name, windows in sets.items()
            if windows is not None
        },
    }
