"""A fitted model on disk: a folder with its weights and a JSON file of all else.

The JSON file has a checksum of the weights, so that a changed bit is found.
"""

from __future__ import annotations

import hashlib
import json
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import torch
from torch import Tensor

from ownrobot.body_file import body_from_mapping, body_to_mapping
from ownrobot.fitting.errors import Score
from ownrobot.methods.boosting import Forest
from ownrobot.methods.closed_form import Trivial
from ownrobot.methods.gaussian_process import Posterior
from ownrobot.methods.kinematics import Kinematics
from ownrobot.methods.least_squares import LeastSquares
from ownrobot.methods.pooled import Pooled
from ownrobot.methods.registry import METHODS
from ownrobot.methods.regression import Regression
from sidm import __version__
from sidm.body import Body
from sidm.config import ConfigError, first_line, from_mapping, to_mapping
from sidm.learning.model import DynamicsModel, Predictor
from sidm.learning.units import Standardisation
from sidm.settings import Network
from sidm.storage import write_atomically

if TYPE_CHECKING:
    from ownrobot.fitting.model import Model

WEIGHTS, ABOUT = "model.safetensors", "model.json"
UNITS = "units."  # begins the names of the units of least squares
INNER = "inner."  # begins the names of the tensors of a model that sees the flag


def refuse_folder(folder: str | Path, body: Body, force: bool = False) -> None:
    """Raise ConfigError, one line, where a model of `body` must not be written.

    `force` says whether it may replace that of another body.
    """
    if not str(folder).strip():
        raise ConfigError("the model's folder has no name; pass a path, as 'model'")
    folder = Path(folder)
    for path in (folder, *folder.parents):
        if path.exists():
            if not path.is_dir():
                raise ConfigError(f"{path} is a file; name a folder for the model")
            break
    if folder.exists() and not os.access(folder, os.W_OK):
        raise ConfigError(f"{folder} cannot be written; name another folder")
    try:
        about = json.loads((folder / ABOUT).read_text(encoding="utf-8"))
        there = body_from_mapping(about["body"], "")
    except (OSError, ValueError, KeyError, TypeError):
        return  # there is no model that can be read
    mappings = [body_to_mapping(one) for one in (there, body)]
    for mapping in mappings:  # how the loss is weighed does not make another robot
        mapping.pop("weights", None)
        mapping.pop("resolution", None)
    if not force and mappings[0] != mappings[1]:
        raise ConfigError(
            f"{folder} has a model of another body, '{there.name}'; name another "
            "folder, or replace it with force=True (--force)"
        )


def write_model(model: Model, folder: str | Path, force: bool = False) -> None:
    """Write a model into a folder, as `Model.save` does."""
    from safetensors.torch import save as to_bytes

    refuse_folder(folder, model.body, force)
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    tensors = {
        name: tensor
        for name, tensor in model.predictor.state_dict().items()
        if ".expert." not in name
    }
    for module in model.predictor.modules():
        if isinstance(module, LeastSquares):  # a base has the units of its correction
            units = module.units._asdict()
            tensors |= {UNITS + name: tensor for name, tensor in units.items()}
    network = {
        name: value
        for name, value in to_mapping(model.network).items()
        if not name.endswith("_body")
    }
    content = to_bytes(
        {n: tensor.contiguous().clone() for n, tensor in tensors.items()}
    )
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
        "sha256": hashlib.sha256(content).hexdigest(),  # of the weights' file
    }
    about["checksum"] = _checksum_of(about)
    write_atomically(folder / WEIGHTS, lambda file: file.write(content))
    text = json.dumps(about, indent=1) + "\n"
    write_atomically(folder / ABOUT, lambda file: file.write(text.encode()))


def read_model(folder: str | Path) -> dict[str, Any]:
    """The fields of the model in a folder, as `ownrobot.load` reads it."""
    from safetensors import SafetensorError
    from safetensors.torch import load as from_bytes

    folder = Path(folder)
    for name in (ABOUT, WEIGHTS):
        if not (folder / name).is_file():
            raise ConfigError(f"{folder}: no model is there, {name} is missing")
    try:
        about = json.loads((folder / ABOUT).read_text(encoding="utf-8"))
        if about.get("checksum", _checksum_of(about)) != _checksum_of(about):
            raise ValueError(f"{ABOUT} was changed")  # older versions have no checksum
        body = body_from_mapping(about["body"], "")
        network = from_mapping(
            Network, about["network"] | {"novice_body": body, "expert_body": body}
        )
        scale, mean = (_as_tensor(about.get(n)) for n in ("scale", "target_mean"))
        content = (folder / WEIGHTS).read_bytes()
        checksum = hashlib.sha256(content).hexdigest()
        if about.get("sha256", checksum) != checksum:  # older versions wrote none
            raise ValueError(f"the checksum of {WEIGHTS} does not match")
        tensors = from_bytes(content)
        predictor = _predictor(about["method"], network, tensors, scale)
        fields = ("method", "steps", "minutes", "test_loss")
        values = {name: about[name] for name in fields}
        if about.get("held_out"):
            values["held_out"] = from_mapping(Score, about["held_out"])
    except (ValueError, KeyError, TypeError, RuntimeError, SafetensorError) as error:
        raise ConfigError(
            f"{folder}: the model is damaged ({first_line(error)}); fit it again"
        ) from None
    return values | {
        "predictor": predictor.eval(),
        "body": body,
        "network": network,
        "scale": scale,
        "target_mean": mean,
    }


def _checksum_of(about: dict[str, Any]) -> str:
    """Checksum of all values of a model's JSON file."""
    values = {name: value for name, value in about.items() if name != "checksum"}
    return hashlib.sha256(json.dumps(values, sort_keys=True).encode()).hexdigest()


def _as_list(values: Tensor | None) -> list[float] | None:
    return None if values is None else values.tolist()


def _as_tensor(values: list[float] | None) -> Tensor | None:
    return None if values is None else torch.tensor(values)


def _predictor(
    method: str, network: Network, tensors: dict[str, Tensor], scale: Tensor | None
) -> Predictor:
    """The module of a method with the weights of a file."""
    config, body = METHODS[method], network.body("novice")
    if config.pooled:
        tensors = {name.removeprefix(INNER): t for name, t in tensors.items()}
    weights = {n: t for n, t in tensors.items() if not n.startswith(UNITS)}

    def least_squares(base: Predictor | None) -> Predictor:
        units = (tensors[UNITS + name] for name in Standardisation._fields)
        return LeastSquares(Standardisation(*units), base, scale)

    name: Any = method  # the models of these methods have the methods' names
    model: Predictor
    if config.fit == "kinematics":
        model = Kinematics(name, body, scale)
    elif config.fit == "trivial":
        model = Trivial(name, body, scale)
    elif config.fit == "gradients":
        model = DynamicsModel(network, roles=["novice"])
    else:
        base: Predictor | None = None
        if config.pretrained:
            base = DynamicsModel(network, roles=["novice"])
        elif config.residual and config.fit != "trees":
            base = least_squares(None)
        if config.fit == "least_squares":
            model = least_squares(base)
        else:
            kind: Any = Forest if config.fit == "trees" else Posterior
            regressions = kind(*(tensors[name] for name in kind._fields))
            model = Regression(body, regressions, base, scale)
    model.load_state_dict(weights)
    return Pooled(model) if config.pooled else model
