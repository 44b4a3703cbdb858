"""A fitted model: what it predicts, how well, and how it is kept in a folder, weights as safetensors and one JSON."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import torch
from torch import Tensor

from sidm import __version__
from sidm.body import SI, Body, body_from, body_lines
from sidm.config import ConfigError, first_line, from_mapping, to_mapping
from sidm.drives import AnyGround, Drive
from sidm.fitting.arguments import drives_from
from sidm.fitting.windows import common_length, cut, rollouts
from sidm.learning.checkpoint import module_tensors
from sidm.learning.dataset import stacked, windows_of
from sidm.learning.evaluation import mean_loss, rollout, rollout_errors
from sidm.learning.losses import component_losses
from sidm.learning.model import DynamicsModel, Predictor
from sidm.learning.units import Standardisation
from sidm.rivals.least_squares import LeastSquares
from sidm.rivals.methods import METHODS
from sidm.settings import Network
from sidm.storage import write_atomically

if TYPE_CHECKING:
    import pandas as pd

    from sidm.fitting.arguments import Drives

WEIGHTS, ABOUT = "model.safetensors", "model.json"
WARM_UP = 4  # steps that a model sees before it predicts open loop


@dataclass(frozen=True, eq=False, repr=False)
class Model:
    """A model of one robot, ready to predict; `sidm.fit` makes it and `sidm.load` reads it.

    Examples:
        >>> model = sidm.load("recordings/models/warthog")
        >>> model.rollout(state=np.zeros(6), actions=np.ones((10, 2))).shape
        (11, 6)
    """

    predictor: Predictor
    body: Body  # what its robot's drives are made of
    method: str  # of `rivals.methods.METHODS`
    steps: int  # of the windows that it was learnt from
    minutes: float  # of the robot's motion learnt from, train and test together
    test_loss: float  # equation (1) on the drives that it was stopped by
    network: Network
    scale: Tensor | None  # (Y,) weights of the components in equation (1); None: all 1
    #: what always predicting the mean costs where `test_loss` was taken; older: None
    mean_loss: float | None = None

    def __repr__(self) -> str:
        return f"Model({self.method!r} of body {self.body.name!r}, from {self.minutes:.2g} min)"

    def loss(self, drives: Drives, topics: Sequence[str] = ()) -> float:
        """Equation (1) on drives that the model has not learnt from, a step, in the units that it was trained in.

        Args:
            drives: as of `evaluate`.
            topics: as of `evaluate`.
        """
        return mean_loss(
            self.predictor,
            windows_of(self._windows(drives, topics), self.network.pixels),
        )

    def evaluate(self, drives: Drives, topics: Sequence[str] = ()) -> pd.DataFrame:
        """How well the model predicts drives that it has not learnt from.

        Args:
            drives: of the model's robot; or a file, a ROS bag or a folder of them.
            topics: of ROS bags that are read, where several could be meant.

        Returns:
            A row for each component of y, one step ahead, and a row for each horizon,
            open loop after WARM_UP steps. Columns: `quantity`; `horizon`, steps;
            `error`, the root mean square error in `unit`; `share`, the error divided by
            that of a trivial prediction. The trivial prediction of a component is the
            drives' mean; the trivial prediction of position (m) and heading (rad) is a
            robot that stays where it is.

        Raises:
            RecordingError: the first fault of a file.
            ConfigError: drives that are too short.
        """
        import pandas as pd

        windows = self._windows(drives, topics)
        tensors = windows_of(windows, self.network.pixels)
        with torch.inference_mode():
            predicted, _ = self.predictor("novice", tensors.inputs, tensors.maps)
        wrong = (
            component_losses(predicted, tensors.targets).double().mean((0, 1)).sqrt()
        )
        spread = tensors.targets.flatten(0, 1).double().std(0, correction=0)
        # those of a pose are those of its change
        units = [SI[unit] for _, unit in self.body.state]
        lines = [
            (name, 1, unit, float(error), float(error / own.clamp_min(1e-12)))
            for name, unit, error, own in zip(
                self.body.targets, units, wrong, spread, strict=True
            )
        ]
        columns = ["quantity", "horizon", "unit", "error", "share"]
        return pd.DataFrame([*lines, *self._horizons(windows)], columns=columns)

    def _windows(self, drives: Drives, topics: Sequence[str]) -> list[Drive]:
        found = drives_from(drives, self.body, "drives", topics, held=True)
        return cut(found, common_length(found))

    def _horizons(
        self, windows: list[Drive]
    ) -> list[tuple[str, int, str, float, float]]:
        """Lines of `evaluate` for open loop."""
        body, ahead = self.body, len(windows[0]) - WARM_UP
        if body.pose == "none" or ahead < 1:
            return []
        path = rollouts(self.predictor, windows, WARM_UP, ahead, self.network.pixels)
        actual = stacked(windows)[0][:, WARM_UP:]
        stays = actual[:, :1].expand_as(actual)
        both = [
            [one.square().mean(0).sqrt() for one in rollout_errors(some, actual, body)]
            for some in (path, stays)
        ]
        names = (("position", "m"), ("heading", "rad"))
        return [
            (
                name,
                step + 1,
                unit,
                float(error[step]),
                float(error[step] / still[step].clamp_min(1e-12)),
            )
            for (name, unit), error, still in zip(names, *both, strict=True)
            for step in range(ahead)
        ]

    def predict(self, drives: Drives, topics: Sequence[str] = ()) -> pd.DataFrame:
        """What the model predicts of drives, each step from the recorded state before it.

        Args:
            drives: as of `evaluate`.
            topics: as of `evaluate`.

        Returns:
            A line a step: `drive`, `time` s, and each component of y as `predicted_...`
            and `actual_...`.

        Raises:
            RecordingError: the first fault of a file.
        """
        import pandas as pd

        lines = []
        for drive in drives_from(drives, self.body, "drives", topics, held=True):
            tensors = windows_of([drive], self.network.pixels)
            with torch.inference_mode():
                predicted, _ = self.predictor("novice", tensors.inputs, tensors.maps)
            values = {
                f"{kind}_{name.replace(' ', '_')}": part[0, :, number].numpy()
                for kind, part in (
                    ("predicted", predicted),
                    ("actual", tensors.targets),
                )
                for number, name in enumerate(self.body.targets)
            }
            time = np.arange(1, len(drive) + 1) / self.body.rate
            lines.append(pd.DataFrame({"drive": drive.name, "time": time} | values))
        return pd.concat(lines, ignore_index=True)

    def rollout(
        self, state: np.ndarray, actions: np.ndarray, ground: AnyGround | None = None
    ) -> np.ndarray:
        """Predict many steps ahead, each from the prediction before it (Figure 4 of the paper).

        Args:
            state: (S,), where the robot starts.
            actions: (K, A), what is done.
            ground: under the robot, of a body with a height map.

        Returns:
            The states (K + 1, S), the given one first.

        Raises:
            ConfigError: the body sees a height map, and there is no ground.
            ValueError: shapes that are not the body's.
        """
        if self.body.map_size and ground is None:
            raise ConfigError(
                f"body '{self.body.name}' sees a height map: pass the ground under it"
            )
        heights, spacing = (
            (None, 0.0) if ground is None else (ground.heights, ground.spacing)
        )
        path = rollout(
            self.predictor,
            heights,
            torch.as_tensor(np.asarray(state, float)),
            torch.as_tensor(np.asarray(actions, float)),
            self.network.pixels,
            spacing=spacing,
            body=self.body,
        )
        return path.numpy()

    def save(self, folder: str | Path) -> None:
        """Write the model; the folder is made where it lacks, and nothing half-written stays.

        Raises:
            OSError: it cannot be written; one line.
        """
        from safetensors.torch import save as packed

        folder = Path(folder)
        folder.mkdir(parents=True, exist_ok=True)
        every = module_tensors(self.predictor)
        tensors = {
            name: one.contiguous()
            for name, one in every.items()
            if ".expert." not in name
        }
        if isinstance(self.predictor, LeastSquares):
            tensors |= {
                f"units.{name}": one
                for name, one in self.predictor.units._asdict().items()
            }
        about = {
            "version": __version__,
            "method": self.method,
            "body": body_lines(self.body),
            "steps": self.steps,
            "minutes": self.minutes,
            "test_loss": self.test_loss,
            "mean_loss": self.mean_loss,
            "scale": None if self.scale is None else self.scale.tolist(),
            "network": {
                k: v
                for k, v in to_mapping(self.network).items()
                if not k.endswith("_body")
            },
        }
        content = packed({name: one.clone() for name, one in tensors.items()})
        write_atomically(folder / WEIGHTS, lambda file: file.write(content))
        text = json.dumps(about, indent=1) + "\n"
        write_atomically(folder / ABOUT, lambda file: file.write(text.encode()))


def load(folder: str | Path) -> Model:
    """A model that `Model.save`, `sidm.fit(out=...)` or `sidm fit` wrote.

    Raises:
        ConfigError: there is none, or it is damaged; one line.

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
        body = body_from(about["body"], "")
        network = from_mapping(
            Network, about["network"] | {"novice_body": body, "expert_body": body}
        )
        scale = None if about["scale"] is None else torch.tensor(about["scale"])
        tensors = load_file(folder / WEIGHTS)
        predictor = _predictor(about["method"], network, tensors, scale)
        values = {
            name: about[name] for name in ("method", "steps", "minutes", "test_loss")
        }
        values["mean_loss"] = about.get("mean_loss")
    except (ValueError, KeyError, TypeError, RuntimeError, SafetensorError) as error:
        raise ConfigError(
            f"{folder}: the model is damaged ({first_line(error)}); fit it again"
        ) from None
    return Model(predictor.eval(), body, network=network, scale=scale, **values)


def _predictor(
    method: str, network: Network, tensors: dict[str, Tensor], scale: Tensor | None
) -> Predictor:
    chosen: Any = METHODS[method]
    if chosen.fit != "least_squares":
        model = DynamicsModel(network, roles=["novice"])
        model.load_state_dict(tensors)
        return model
    units = Standardisation(
        *(tensors.pop(f"units.{name}") for name in Standardisation._fields)
    )
    base = DynamicsModel(network, roles=["novice"]) if chosen.pretrained else None
    found = LeastSquares(units, base, scale)
    found.load_state_dict(tensors)
    return found
