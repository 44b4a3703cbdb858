"""A run's state on disk: arrays and one JSON text in a single sealed .npz file.

An array's name is its path in the state: 'model/sidm.lstm.weight_ih_l0',
'optimisers/prediction/12/exp_avg'.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn

from sidm.config import Fault
from sidm.storage import checksum, read_arrays, write_arrays

FILE = "checkpoint.npz"
TEXT = "json"  # the name of the array that holds the text


class CheckpointError(Fault):
    """A checkpoint that is damaged or of another run; the message is one line that names the file and the mend."""


def write(
    folder: Path, tensors: Mapping[str, Tensor], values: Mapping[str, Any]
) -> None:
    """Write `tensors` of any shapes and `values` (plain JSON types) as `folder`'s checkpoint, in place of the last."""
    arrays = {name: tensor.detach().cpu().numpy() for name, tensor in tensors.items()}
    arrays[TEXT] = np.frombuffer(json.dumps(values).encode(), np.uint8)
    write_arrays(Path(folder) / FILE, arrays)


def read(folder: Path) -> tuple[dict[str, Tensor], dict[str, Any]] | None:
    """What `write` wrote; None when there is nothing.

    Raises:
        CheckpointError: the file is damaged.
    """
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


def under(prefix: str, tensors: Mapping[str, Tensor]) -> dict[str, Tensor]:
    """The tensors whose names begin with `prefix` and a slash, by the rest of their names."""
    return {
        name[len(prefix) + 1 :]: tensor
        for name, tensor in tensors.items()
        if name.startswith(f"{prefix}/")
    }


def prefixed(prefix: str, tensors: Mapping[str, Tensor]) -> dict[str, Tensor]:
    """The same tensors with `prefix` and a slash before their names."""
    return {f"{prefix}/{name}": tensor for name, tensor in tensors.items()}


def digest(tensors: Iterable[Tensor]) -> str:
    """A checksum of tensors of one type, one after the other."""
    return checksum(torch.cat([tensor.flatten() for tensor in tensors]).cpu().numpy())


def module_tensors(module: nn.Module) -> dict[str, Tensor]:
    """Weights and buffers by name, not copied."""
    return {name: tensor.detach() for name, tensor in module.state_dict().items()}


def optimiser_tensors(optimiser: torch.optim.Optimizer) -> dict[str, Tensor]:
    """The optimiser's moments, in their parameters' shapes, and step counts (), by 'parameter number/name'."""
    state = optimiser.state_dict()["state"]
    return {
        f"{number}/{name}": tensor
        for number, entry in state.items()
        for name, tensor in entry.items()
    }


def load_optimiser(
    optimiser: torch.optim.Optimizer, tensors: Mapping[str, Tensor]
) -> None:
    """Put back what `optimiser_tensors` gave."""
    parameters = [
        parameter for group in optimiser.param_groups for parameter in group["params"]
    ]
    state: dict[int, dict[str, Tensor]] = {}
    for path, tensor in tensors.items():
        number, name = path.split("/")
        # the fused kernels walk moments and weights in memory order: give them the
        # weights' layout
        if tensor.ndim:
            tensor = torch.empty_like(parameters[int(number)]).copy_(tensor)
        state.setdefault(int(number), {})[name] = tensor
    optimiser.load_state_dict(
        {"state": state, "param_groups": optimiser.state_dict()["param_groups"]}
    )
