"""A fitted model: its predictions and its errors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import torch
from torch import Tensor

from sidm.body import SI, Body
from sidm.config import ConfigError
from sidm.drives import AnyGround, Drive
from sidm.fitting.arguments import drives_from
from sidm.fitting.score import Score, WindowLosses
from sidm.fitting.windows import common_length, cut, rollouts
from sidm.learning.dataset import states_and_actions, windows_of
from sidm.learning.evaluation import rollout, rollout_errors, window_losses
from sidm.learning.losses import component_losses
from sidm.learning.model import Predictor
from sidm.settings import Network

if TYPE_CHECKING:
    import pandas as pd

    from sidm.fitting.arguments import Drives

WARM_UP = 4  # recorded steps that a model sees before it predicts open loop


@dataclass(frozen=True, eq=False, repr=False)
class Model:
    """A fitted model of one robot; `sidm.fit` and `sidm.load` return it.

    Examples:
        >>> model = sidm.load("recordings/models/warthog")
        >>> model.rollout(state=np.zeros(6), actions=np.ones((10, 2))).shape
        (11, 6)
    """

    predictor: Predictor
    body: Body  # what the robot's drives are made of
    method: str  # a name in `rivals.methods.METHODS`
    steps: int  # T, length of the windows that the model was fitted to
    minutes: float  # of the robot's motion used, training and test together
    test_loss: float  # equation (1) on the drives that stopped the training
    network: Network
    scale: Tensor | None  # (Y,) weights of the components in equation (1); None: all 1
    #: (Y,) mean of y in training; None in files of older versions
    target_mean: Tensor | None = None
    #: loss on drives that were held out from the training, if any were
    held_out: Score | None = None

    def __repr__(self) -> str:
        data = f"body {self.body.name!r}, from {self.minutes:.2g} min"
        return f"Model({self.method!r} of {data})"

    def loss(self, drives: Drives, topics: Sequence[str] = ()) -> float:
        """Mean loss of a step, equation (1), on drives that the model has not seen.

        Args:
            drives: as in `evaluate`.
            topics: as in `evaluate`.

        Returns:
            The loss, with the weights of the components as in the training.
        """
        return self.score(drives, topics).loss

    def score(self, drives: Drives, topics: Sequence[str] = ()) -> Score:
        """The loss on drives that the model has not seen, with its standard error.

        Args:
            drives: as in `evaluate`.
            topics: as in `evaluate`.

        Examples:
            >>> model = sidm.load("recordings/models/warthog")
            >>> model.score("recordings/warthog.csv.gz").drives
            287
        """
        return self.losses(self._drives(drives, topics)).score()

    def losses(self, drives: list[Drive]) -> WindowLosses:
        """Losses of the windows of the drives, which have the model's body."""
        windows = cut(drives, common_length(drives))
        tensors = windows_of(windows, self.network.pixels)
        mean_losses = None
        if self.target_mean is not None:
            mean = self.target_mean.expand_as(tensors.targets)
            terms = component_losses(mean, tensors.targets, self.scale)
            mean_losses = terms.sum(-1).double().mean(1).numpy()
        return WindowLosses(
            window_losses(self.predictor, tensors).numpy(),
            mean_losses,
            np.array([window.name for window in windows]),
            np.array([window.session for window in windows]),
        )

    def evaluate(self, drives: Drives, topics: Sequence[str] = ()) -> pd.DataFrame:
        """Errors of the model's predictions on drives that it has not seen.

        Args:
            drives: drives of the model's robot; or a file, a ROS bag or a folder of
                drives, or several; or a pandas table.
            topics: topics of ROS bags, needed if a bag has several matching topics.

        Returns:
            A row for each component of y, one step ahead, and a row for each horizon,
            open loop after WARM_UP steps. Columns: `quantity`; `horizon`, steps;
            `error`, the root mean square error in `unit`; `share`, the error divided by
            that of a trivial prediction. The trivial prediction of a component is the
            drives' mean; the trivial prediction of position (m) and heading (rad) is a
            robot that stays where it is.

        Raises:
            RecordingError: the first fault of a file.
            ConfigError: the drives are too short.
        """
        import pandas as pd

        windows = self._windows(drives, topics)
        tensors = windows_of(windows, self.network.pixels)
        with torch.inference_mode():
            predicted, _ = self.predictor("novice", tensors.inputs, tensors.maps)
        losses = component_losses(predicted, tensors.targets).double()
        errors = losses.mean((0, 1)).sqrt()
        deviations = tensors.targets.flatten(0, 1).double().std(0, correction=0)
        shares = errors / deviations.clamp_min(1e-12)
        # A pose has the same units as its change, which is what the model predicts.
        units = [SI[unit] for _, unit in self.body.state]
        rows = [
            (name, 1, unit, float(error), float(share))
            for name, unit, error, share in zip(
                self.body.targets, units, errors, shares, strict=True
            )
        ]
        columns = ["quantity", "horizon", "unit", "error", "share"]
        return pd.DataFrame([*rows, *self._horizons(windows)], columns=columns)

    def _windows(self, drives: Drives, topics: Sequence[str]) -> list[Drive]:
        checked = self._drives(drives, topics)
        return cut(checked, common_length(checked))

    def _drives(self, drives: Drives, topics: Sequence[str]) -> list[Drive]:
        return drives_from(drives, self.body, "drives", topics, allow_constant=True)

    def _horizons(
        self, windows: list[Drive]
    ) -> list[tuple[str, int, str, float, float]]:
        """Rows of `evaluate` for open loop."""
        body, ahead = self.body, len(windows[0]) - WARM_UP
        if body.pose == "none" or ahead < 1:
            return []
        path = rollouts(self.predictor, windows, WARM_UP, ahead, self.network.pixels)
        actual = states_and_actions(windows)[0][:, WARM_UP:]
        standing = actual[:, :1].expand_as(actual)
        errors, trivial_errors = (
            [error.square().mean(0).sqrt() for error in rollout_errors(x, actual, body)]
            for x in (path, standing)
        )
        rows = []
        for number, (name, unit) in enumerate((("position", "m"), ("heading", "rad"))):
            shares = errors[number] / trivial_errors[number].clamp_min(1e-12)
            for step in range(ahead):
                error, share = float(errors[number][step]), float(shares[step])
                rows.append((name, step + 1, unit, error, share))
        return rows

    def predict(self, drives: Drives, topics: Sequence[str] = ()) -> pd.DataFrame:
        """Predictions one step ahead, each from the recorded state before it.

        Args:
            drives: as in `evaluate`.
            topics: as in `evaluate`.

        Returns:
            A row for each step: `drive`, the drive's name; `time`, s; and each
            component of y as `predicted_...` and `actual_...`.

        Raises:
            RecordingError: the first fault of a file.
        """
        import pandas as pd

        tables = []
        for drive in self._drives(drives, topics):
            tensors = windows_of([drive], self.network.pixels)
            with torch.inference_mode():
                predicted, _ = self.predictor("novice", tensors.inputs, tensors.maps)
            columns = {
                "drive": drive.name,
                "time": np.arange(1, len(drive) + 1) / self.body.rate,
            }
            for kind, y in (("predicted", predicted), ("actual", tensors.targets)):
                for number, name in enumerate(self.body.targets):
                    column = f"{kind}_{name.replace(' ', '_')}"
                    columns[column] = y[0, :, number].numpy()
            tables.append(pd.DataFrame(columns))
        return pd.concat(tables, ignore_index=True)

    def rollout(
        self, state: np.ndarray, actions: np.ndarray, ground: AnyGround | None = None
    ) -> np.ndarray:
        """Predict many steps ahead, each from the prediction before it (Figure 4).

        Args:
            state: (S,), state of the robot at the start.
            actions: (K, A), the robot's actions.
            ground: ground under the robot, for a body with a height map.

        Returns:
            States (K + 1, S); the first is `state`.

        Raises:
            ConfigError: the body sees a height map, and no ground is given.
            ValueError: `state` or `actions` has another shape than the body asks for.
        """
        if self.body.map_size and ground is None:
            raise ConfigError(
                f"body '{self.body.name}' sees a height map: pass the ground under it"
            )
        heights, spacing = None, 0.0
        if ground is not None:
            heights, spacing = ground.heights, ground.spacing
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
        """Write the model's files into a folder, which is created where it is missing.

        Each file is written completely or not at all.

        Raises:
            OSError: a file cannot be written; the message is one line.
        """
        from sidm.fitting.files import write_model  # which imports this module

        write_model(self, folder)
