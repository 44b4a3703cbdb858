"""A fitted model in a folder: weights as safetensors, all else as one JSON."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, NamedTuple

import torch
from torch import Tensor

from sidm import __version__
from sidm.body import Body, body_from, body_lines
from sidm.config import ConfigError, first_line, from_mapping, to_mapping
from sidm.learning.checkpoint import module_tensors
from sidm.learning.model import DynamicsModel, Predictor
from sidm.learning.units import Standardisation
from sidm.rivals.least_squares import LeastSquares
from sidm.rivals.methods import METHODS
from sidm.settings import Network
from sidm.storage import write_atomically

WEIGHTS, ABOUT = "model.safetensors", "model.json"


class RobotModel(NamedTuple):
    """A robot's model, ready to predict."""

    predictor: Predictor
    body: Body
    method: str  # of `rivals.methods.METHODS`
    steps: int  # of the pieces that it was learnt from
    minutes: float  # of the robot's motion learnt from, train and test together
    test_loss: float  # equation (1) on the drives that it was stopped by
    network: Network
    scale: Tensor | None  # (Y,) weights of the components in equation (1); None: all 1
    mean_loss: float | None = None  # what always predicting the mean costs where `test_loss` was taken; older: None


def save(model: RobotModel, folder: str | Path) -> None:
    """Write a model; the folder is made where it lacks, and nothing half-written stays.

    Raises:
        OSError: it cannot be written; one line.
    """
    from safetensors.torch import save as packed

    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    every = module_tensors(model.predictor)
    tensors = {name: one.contiguous() for name, one in every.items() if ".expert." not in name}
    if isinstance(model.predictor, LeastSquares):
        tensors |= {f"units.{name}": one for name, one in model.predictor.units._asdict().items()}
    about = {
        "version": __version__, "method": model.method, "body": body_lines(model.body), "steps": model.steps,
        "minutes": model.minutes, "test_loss": model.test_loss, "mean_loss": model.mean_loss,
        "scale": None if model.scale is None else model.scale.tolist(),
        "network": {k: v for k, v in to_mapping(model.network).items() if not k.endswith("_body")},
    }  # fmt: skip
    content = packed({name: one.clone() for name, one in tensors.items()})
    write_atomically(folder / WEIGHTS, lambda file: file.write(content))
    text = json.dumps(about, indent=1) + "\n"
    write_atomically(folder / ABOUT, lambda file: file.write(text.encode()))


def load(folder: str | Path) -> RobotModel:
    """A model that `save` wrote.

    Raises:
        ConfigError: there is none, or it is damaged; one line.
    """
    from safetensors import SafetensorError
    from safetensors.torch import load_file

    folder = Path(folder)
    for name in (ABOUT, WEIGHTS):
        if not (folder / name).is_file():
            raise ConfigError(f"{folder}: no model is there, {name} is missing")
    try:
        about = json.loads((folder / ABOUT).read_text(encoding="utf-8"))
        body = body_from(about["body"], "")
        network = from_mapping(Network, about["network"] | {"novice_body": body, "expert_body": body})
        scale = None if about["scale"] is None else torch.tensor(about["scale"])
        tensors = load_file(folder / WEIGHTS)
        predictor = _predictor(about["method"], network, tensors, scale)
        values = {name: about[name] for name in ("method", "steps", "minutes", "test_loss")}
        values["mean_loss"] = about.get("mean_loss")
    except (ValueError, KeyError, TypeError, RuntimeError, SafetensorError) as error:
        raise ConfigError(f"{folder}: the model is damaged ({first_line(error)}); fit it again") from None
    return RobotModel(predictor.eval(), body, network=network, scale=scale, **values)


def _predictor(method: str, network: Network, tensors: dict[str, Tensor], scale: Tensor | None) -> Predictor:
    one: Any = METHODS[method]
    if one.fit != "least_squares":
        model = DynamicsModel(network, roles=["novice"])
        model.load_state_dict(tensors)
        return model
    units = Standardisation(*(tensors.pop(f"units.{name}") for name in Standardisation._fields))
    base = DynamicsModel(network, roles=["novice"]) if one.pretrained else None
    found = LeastSquares(units, base, scale)
    found.load_state_dict(tensors)
    return found
