"""A fitted model: its predictions and its errors."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import torch
from torch import Tensor

from ownrobot.fitting.arguments import drives_from
from ownrobot.fitting.errors import Score, one_step_rows, open_loop_rows, score_of
from ownrobot.fitting.files import read_model, write_model
from ownrobot.fitting.windows import Steps, common_length, cut, predict_steps, rollouts
from sidm.body import Body
from sidm.config import ConfigError
from sidm.drives import AnyGround, Drive, Ground
from sidm.learning.dataset import states_and_actions
from sidm.learning.evaluation import rollout
from sidm.learning.losses import component_losses
from sidm.learning.model import Predictor
from sidm.settings import Network

if TYPE_CHECKING:
    import pandas as pd

    from ownrobot.fitting.arguments import Drives

WARM_UP = 4  # recorded steps that a model sees before it predicts open loop


@dataclass(frozen=True, eq=False, repr=False)
class Model:
    """A fitted model of one robot; `ownrobot.fit` and `ownrobot.load` return it.

    Examples:
        >>> model = ownrobot.load("recordings/models/warthog")
        >>> model.rollout(state=np.zeros(6), actions=np.ones((10, 2))).shape
        (11, 6)
    """

    predictor: Predictor
    body: Body  # what the robot's drives are made of
    method: str  # a name in `ownrobot.methods.registry.METHODS`
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
        """Mean loss of a step, equation (1), on drives as those of `evaluate`.

        The weights of the components are those of the training.
        """
        return self.score(drives, topics).loss

    def score(self, drives: Drives, topics: Sequence[str] = ()) -> Score:
        """The loss on drives as those of `evaluate`, with its standard error.

        Examples:
            >>> model = ownrobot.load("recordings/models/warthog")
            >>> model.score("recordings/warthog.csv.gz").drives
            287
        """
        return score_of(self.losses(self._drives(drives, topics)))

    def losses(self, drives: Sequence[Drive]) -> pd.DataFrame:
        """The loss of each of the drives, which have the model's body, in their order.

        Returns:
            The columns of `evaluate_drives`, with the number of `steps` in place of the
            seconds.
        """
        import pandas as pd

        rows = []
        for drive, (predicted, actual) in zip(
            drives, self._one_step(drives), strict=True
        ):
            terms, mean = self._terms(predicted, actual), np.nan
            if self.target_mean is not None:
                mean = self._terms(self.target_mean.expand_as(actual), actual).sum()
            worst = self.body.targets[terms.argmax()]
            about = drive.name, drive.session, len(drive)
            rows.append((*about, terms.sum(), mean, worst))
        names = ["drive", "session", "steps", "loss", "mean", "worst"]
        return pd.DataFrame(rows, columns=names)

    def _terms(self, predicted: Tensor, actual: Tensor) -> np.ndarray:
        """Terms (Y,) of equation (1), means over the steps."""
        losses = component_losses(predicted, actual, self.scale)
        return losses.double().mean(0).numpy()

    def evaluate(self, drives: Drives, topics: Sequence[str] = ()) -> pd.DataFrame:
        """Errors of the model's predictions on drives that it has not seen.

        Args:
            drives: drives of the model's robot; or a file, a ROS bag or a folder of
                drives, or several; or a pandas table. The first fault of a file is a
                RecordingError.
            topics: topics of ROS bags, needed if a bag has several matching topics.

        Returns:
            A row for each component of y, one step ahead, and rows for position,
            heading and each other number at each horizon, open loop, after the model
            has seen WARM_UP steps. Columns: `prediction`, 'one step' or 'open loop';
            `quantity`; `horizon`, s; `unit`; `rmse`, the root mean square error;
            `average` and `median` of the errors' sizes; `nothing_changes` and `mean`,
            the root mean square errors of two predictions that learn nothing
            (`fitting.errors`).

        Examples:
            >>> model = ownrobot.load("recordings/models/warthog")
            >>> table = model.evaluate("recordings/warthog.csv.gz")
            >>> table.quantity[:3].tolist()
            ['forward', 'left', 'turn']
        """
        import pandas as pd

        checked = self._drives(drives, topics)
        rows = list(one_step_rows(self._one_step(checked), checked))
        windows = cut(checked, common_length(checked), overlap=True)
        ahead = len(windows[0]) - WARM_UP
        if ahead > 0:
            pixels = self.network.pixels
            path = rollouts(self.predictor, windows, WARM_UP, ahead, pixels)
            actual = states_and_actions(windows)[0][:, WARM_UP:]
            rows += open_loop_rows(path, actual, self.body)
        return pd.DataFrame(rows)

    def evaluate_drives(
        self, drives: Drives, topics: Sequence[str] = ()
    ) -> pd.DataFrame:
        """The loss of each of the drives, given as to `evaluate`, the worst first.

        Returns:
            A row for each drive: `drive` and `session`, names; `seconds`; `loss`, mean
            of a step; `mean`, the loss of predicting the mean of the training drives;
            `worst`, the component of y with the largest part of the loss.
        """
        table = self.losses(self._drives(drives, topics))
        table.insert(2, "seconds", table.pop("steps") / self.body.rate)
        return table.sort_values("loss", ascending=False, ignore_index=True)

    def _drives(self, drives: Drives, topics: Sequence[str]) -> list[Drive]:
        return drives_from(drives, self.body, "drives", topics, allow_constant=True)

    def _one_step(self, drives: Sequence[Drive]) -> list[Steps]:
        return predict_steps(self.predictor, drives, self.network.pixels)

    def predict(
        self,
        drives: Drives,
        topics: Sequence[str] = (),
        *,
        horizon: float | None = None,
        every: int | None = None,
    ) -> pd.DataFrame:
        """Predictions one step ahead, or open loop over a horizon.

        Args:
            drives: as in `evaluate`.
            topics: as in `evaluate`.
            horizon: seconds that are predicted open loop, each state from the predicted
                state before it; by default each prediction is one step ahead, from the
                recorded state before it.
            every: steps from one start of an open-loop prediction to the next; by
                default there is one start, that of the drive. A model first sees the
                steps before a start.

        Returns:
            A row for each predicted step: `drive`, the drive's name; with a horizon,
            `start [s]`; `time [s]`; then, as `predicted ...` and `actual ...`, each
            component of y, or with a horizon each number of the state, with its SI unit
            in brackets.

        Examples:
            >>> model = ownrobot.load("recordings/models/warthog")
            >>> model.predict("recordings/warthog.csv.gz", horizon=1.0).columns[2:4]
            Index(['time [s]', 'predicted x [m]'], dtype='str')
        """
        from ownrobot.fitting.tables import one_step_table, open_loop_table

        checked = self._drives(drives, topics)
        if horizon is None:
            return one_step_table(checked, self._one_step(checked))
        if not math.isfinite(horizon):
            raise ConfigError(f"a horizon is a number of seconds, not {horizon}")
        steps = round(horizon * self.body.rate)
        if steps < 1:
            raise ConfigError(
                f"a horizon of {horizon:g} s is below one step of "
                f"{1 / self.body.rate:g} s"
            )
        if every is not None and every < 1:
            raise ConfigError(f"every must be at least 1 step, not {every}")
        pixels, seen = self.network.pixels, self.steps // 2
        return open_loop_table(self.predictor, checked, steps, every, seen, pixels)

    def rollout(
        self, state: np.ndarray, actions: np.ndarray, ground: AnyGround | None = None
    ) -> np.ndarray:
        """Predict many steps ahead, each from the prediction before it (Figure 4).

        States (K + 1, S) from the `state` (S,) at the start, which is the first, and
        the robot's `actions` (K, A). A body with a height map needs the `ground` under
        the robot. A network begins without memory here; `predict` lets it see the steps
        before.
        """
        if self.body.map_size and ground is None:
            raise ConfigError(
                f"body '{self.body.name}' sees a height map: pass the ground under it"
            )
        state, origin = np.array(state, float), np.zeros(2)
        if isinstance(ground, Ground) and self.body.pose_size:
            origin = np.array(ground.centre)
            state[:2] -= origin  # maps are cut around the middle of the ground
        path = rollout(
            self.predictor,
            None if ground is None else ground.heights,
            torch.as_tensor(state),
            torch.as_tensor(np.asarray(actions, float)),
            self.network.pixels,
            spacing=0.0 if ground is None else ground.spacing,
            body=self.body,
        ).numpy()
        if self.body.pose_size:
            path[:, :2] += origin
        if self.body.pose == "planar":
            path[:, 2] = np.unwrap(path[:, 2])
        return path

    def save(self, folder: str | Path, force: bool = False) -> None:
        """Write the model's files, each whole or not at all, into a folder.

        A model of the same body in the folder is replaced, with `force` that of another
        body, too; otherwise that is a ConfigError.
        """
        write_model(self, folder, force)


def load(folder: str | Path) -> Model:
    """Read a model that `Model.save`, `ownrobot.fit(out=...)` or `ownrobot fit` wrote.

    A folder without a model and a damaged model are a ConfigError of one line.

    Examples:
        >>> ownrobot.load("recordings/models/warthog")
        Model('pretrain_finetune' of body 'skid-steered', from 9.1 min)
    """
    return Model(**read_model(folder))
