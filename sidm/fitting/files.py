"""A fitted model on disk: a folder with its weights and a JSON file of all else."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from sidm import __version__
from sidm.body import body_from_mapping, body_to_mapping
from sidm.config import ConfigError, first_line, from_mapping, to_mapping
from sidm.fitting.model import Model
from sidm.fitting.score import Score
from sidm.learning.checkpoint import module_tensors
from sidm.learning.model import DynamicsModel, Predictor
from sidm.learning.units import Standardisation
from sidm.rivals.least_squares import LeastSquares
from sidm.rivals.methods import METHODS
from sidm.settings import Network
from sidm.storage import write_atomically

WEIGHTS, ABOUT = "model.safetensors", "model.json"


def write_model(model: Model, folder: str | Path) -> None:
    """Write a model into a folder, as `Model.save` does."""
    from safetensors.torch import save as to_bytes

    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    tensors = {
        name: tensor.contiguous()
        for name, tensor in module_tensors(model.predictor).items()
        if ".expert." not in name
    }
    if isinstance(model.predictor, LeastSquares):
        units = model.predictor.units._asdict()
        tensors |= {f"units.{name}": tensor for name, tensor in units.items()}
    network = {
        name: value
        for name, value in to_mapping(model.network).items()
        if not name.endswith("_body")
    }
    about = {
        "version": __version__,
        "method": model.method,
        "body": body_to_mapping(model.body),
        "steps": model.steps,
        "minutes": model.minutes,
        "test_loss": model.test_loss,
        "target_mean": _as_list(model.target_mean),
        "held_out": model.held_out and to_mapping(model.held_out),
        "scale": _as_list(model.scale),
        "network": network,
    }
    content = to_bytes({name: tensor.clone() for name, tensor in tensors.items()})
    write_atomically(folder / WEIGHTS, lambda file: file.write(content))
    text = json.dumps(about, indent=1) + "\n"
    write_atomically(folder / ABOUT, lambda file: file.write(text.encode()))


def load(folder: str | Path) -> Model:
    """Read a model that `Model.save`, `sidm.fit(out=...)` or `sidm fit` wrote.

    Raises:
        ConfigError: the folder has no model, or the model is damaged; the message is
            one line.

    Examples:
        >>> sidm.load("recordings/models/warthog")
        Model('pretrain_finetune' of body 'skid-steered', from 9.1 min)
    """
    from safetensors import SafetensorError
    from safetensors.torch import load_file

    folder = Path(folder)
    for name in (ABOUT, WEIGHTS):
        if not (folder / name).is_file():
            raise ConfigError(f"{folder}: no model is there, {name} is missing")
    try:
        about = json.loads((folder / ABOUT).read_text(encoding="utf-8"))
        body = body_from_mapping(about["body"], "")
        network = from_mapping(
            Network, about["network"] | {"novice_body": body, "expert_body": body}
        )
        scale, mean = (_as_tensor(about.get(n)) for n in ("scale", "target_mean"))
        tensors = load_file(folder / WEIGHTS)
        predictor = _predictor(about["method"], network, tensors, scale)
        fields = ("method", "steps", "minutes", "test_loss")
        values = {name: about[name] for name in fields}
        if about.get("held_out"):
            values["held_out"] = from_mapping(Score, about["held_out"])
    except (ValueError, KeyError, TypeError, RuntimeError, SafetensorError) as error:
        raise ConfigError(
            f"{folder}: the model is damaged ({first_line(error)}); fit it again"
        ) from None
    return Model(
        predictor.eval(),
        body,
        network=network,
        scale=scale,
        target_mean=mean,
        **values,
    )


def _as_list(values: Tensor | None) -> list[float] | None:
    return None if values is None else values.tolist()


def _as_tensor(values: list[float] | None) -> Tensor | None:
    return None if values is None else torch.tensor(values)


def _predictor(
    method: str, network: Network, tensors: dict[str, Tensor], scale: Tensor | None
) -> Predictor:
    """The module of a method with the weights of a file."""
    config: Any = METHODS[method]
    if config.fit != "least_squares":
        model = DynamicsModel(network, roles=["novice"])
        model.load_state_dict(tensors)
        return model
    units = Standardisation(
        *(tensors.pop(f"units.{name}") for name in Standardisation._fields)
    )
    base = DynamicsModel(network, roles=["novice"]) if config.pretrained else None
    closed_form = LeastSquares(units, base, scale)
    closed_form.load_state_dict(tensors)
    return closed_form
