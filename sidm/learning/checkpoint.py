"""A run's state on disk: arrays and one JSON text in an .npz file with a checksum.

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

from sidm.config import DataError
from sidm.storage import checksum, read_arrays, write_arrays

FILE = "checkpoint.npz"
TEXT = "json"  # the name of the array that holds the text


class CheckpointError(DataError):
    """A checkpoint that is damaged or belongs to another run.

    The message is one line that names the file and says what to do.
    """


def write(
    folder: Path, tensors: Mapping[str, Tensor], values: Mapping[str, Any]
) -> None:
    """Write the checkpoint of `folder`, tensors and values of plain JSON types.

    It replaces the previous one.
    """
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


def module_tensors(module: nn.Module) -> dict[str, Tensor]:
    """A module's weights and buffers by name, not copied."""
    return {name: tensor.detach() for name, tensor in module.state_dict().items()}


def optimiser_tensors(optimiser: torch.optim.Optimizer) -> dict[str, Tensor]:
    """An optimiser's moments and step counts by 'parameter number/name', not copied.

    Moments have the shapes of their parameters; step counts are scalars ().
    """
    state = optimiser.state_dict()["state"]
    return {
        f"{number}/{name}": tensor
        for number, entry in state.items()
        for name, tensor in entry.items()
    }


def load_optimiser(
    optimiser: torch.optim.Optimizer, tensors: Mapping[str, Tensor]
) -> None:
    """Load the tensors that `optimiser_tensors` gave."""
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
