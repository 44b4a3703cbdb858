"""From drives to a model of the robot, and from a model to what it predicts: `sidm fit`, `evaluate`, `predict`."""

from __future__ import annotations

import contextlib
import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np
import torch

from sidm.body import SI, Body, read_body
from sidm.config import ConfigError
from sidm.fitting.learning import datasets, learn, network_for, pretrain, refuse_method, units_in
from sidm.fitting.model import RobotModel, save
from sidm.fitting.settings import settings
from sidm.fitting.windows import Pieces, common_length, cut, learn_and_test, session_order
from sidm.learning.arithmetic import one_thread
from sidm.learning.evaluation import rollout_errors
from sidm.learning.losses import component_losses, prediction_loss
from sidm.learning.stopping import Tested
from sidm.learning.units import loss_weights, units_for
from sidm.progress import progress_bar
from sidm.recordings import Drive, read_drives
from sidm.settings import Network, Training

if TYPE_CHECKING:
    import pandas as pd

UNFINISHED = "unfinished"  # a folder in the model's, of the state to go on from
WARM_UP = 4  # steps that a model sees before it predicts open loop

Drives = str | Path | Sequence[Drive]


def fit(
    novice: Drives,
    expert: Drives | None = None,
    body: Body | str | Path | None = None,
    expert_body: Body | str | Path | None = None,
    method: str | None = None,
    out: str | Path | None = None,
    seed: int = 0,
    topics: Sequence[str] = (),
    progress: bool = False,
    network: Network | None = None,
    training: Training | None = None,
    values: Mapping[str, Any] = MappingProxyType({}),
) -> RobotModel:
    """Learn a robot from its drives, with another robot's if there are any.

    Args:
        novice: a file or a folder of drives, or drives that are read already.
        expert: of another robot, whose motion is cheaper.
        body: what the novice's data are made of, or the file that says it.
        expert_body: the expert's; as the novice's unless given.
        method: one of `rivals.methods.METHODS`; 'sidm' with an expert and 'novice_only' without one by default.
        out: a folder for the model; it also keeps an unfinished training, which the same call goes on with.
        seed: of the choice of drives to stop by, the initial weights and the batches.
        topics: of ROS bags that are read, where several could be meant.
        progress: whether to show it, with the time left at most.
        network: sizes of the networks, as of `settings.settings`, as are the next two.
        training: settings of the training.
        values: single settings of both, by name.

    Returns:
        The model, written to `out` if given.

    Raises:
        RecordingError: the first fault of a file of drives.
        ConfigError: a body, a method or a setting that these robots cannot be learnt with.
    """
    chosen = settings(network, training, values)
    if body is None:
        raise ConfigError("say what the drives are made of: --body robot.yaml, as the page on your own robot shows")
    if expert is None and expert_body is not None:
        raise ConfigError("--expert-body is that of an expert's drives: name them with --expert")
    if seed < 0:
        raise ConfigError(f"--seed must be 0 or more, not {seed}")
    mine = _body(body)
    theirs = mine if expert_body is None else _body(expert_body)
    method = method or ("sidm" if expert is not None else "novice_only")
    refuse_method(method, mine, None if expert is None else theirs)
    own = _drives(novice, mine, topics)
    other = None if expert is None else _drives(expert, theirs, topics)
    steps = common_length(own, *([other] if other else []))
    pieces = cut(own, mine, steps)
    parts = learn_and_test(pieces, session_order(pieces, seed))
    network = network_for(chosen, mine, theirs)
    sets = datasets(*parts, parts[1], None if other is None else cut(other, theirs, steps), network.pixels)
    state = None if out is None else Path(out) / UNFINISHED
    folders = [state / name if state else None for name in ("pretraining", "training")]
    most = chosen.training.max_samples
    with one_thread():
        with _watched("pretraining, at most", most, progress) as tell:
            start = pretrain(method, sets, network, seed, chosen, folder=folders[0], progress=tell)
        with _watched(f"fitting {method}, at most", most, progress) as tell:
            trained = learn(method, sets, network, seed, chosen, start=start, folder=folders[1], progress=tell)
    units = units_for(units_in(sets, network), "novice")
    scale, judged = loss_weights(mine, units), sets.test.targets
    mean = prediction_loss(units.target_mean.expand_as(judged), judged, scale).mean()
    model = RobotModel(
        trained.model.eval(), mine, method, steps, pieces.minutes, float(trained.best_test_loss), network, scale,
        float(mean),
    )
    if out is not None:
        save(model, out)
        shutil.rmtree(Path(out) / UNFINISHED, ignore_errors=True)
    return model


@contextlib.contextmanager
def _watched(title: str, most: int, shown: bool) -> Iterator[Callable[[Tested], None]]:
    """What a training of at most so many samples is to call after each test."""
    with progress_bar(most, title, "sample", shown, scaled=True) as bar:
        yield lambda tested: bar.update(max(0, tested.samples - bar.n))


def _body(body: Body | str | Path) -> Body:
    return body if isinstance(body, Body) else read_body(body)


def _drives(drives: Drives, body: Body, topics: Sequence[str], held: bool = False) -> Sequence[Drive]:
    return read_drives(drives, body, topics, held) if isinstance(drives, (str, Path)) else drives


def evaluate(model: RobotModel, drives: Drives, topics: Sequence[str] = ()) -> pd.DataFrame:
    """How well a model predicts drives that it has not learnt from; `topics` as of `fit`.

    Returns:
        A line a component of y and a line a horizon: `quantity`, `horizon` in steps (1 for components), `error`, the
        root mean square in the `unit`, and `share`, of it that predicting the drives' mean would leave; of a horizon
        that of the position in m, or of the heading in rad, open loop after WARM_UP steps, its share that of a robot
        that stays as it is.

    Raises:
        RecordingError: the first fault of a file; ConfigError: drives that are too short.
    """
    import pandas as pd

    body = model.body
    found = _drives(drives, body, topics, held=True)
    pieces = cut(found, body, common_length(found))
    motion = pieces.motion(model.network.pixels)
    with torch.inference_mode():
        predicted, _ = model.predictor("novice", motion.inputs, motion.maps)
    wrong = component_losses(predicted, motion.targets).double().mean((0, 1)).sqrt()
    spread = motion.targets.flatten(0, 1).double().std(0, correction=0)
    units = [SI[unit] for _, unit in body.state]  # those of a pose are those of its change
    lines = [
        (name, 1, unit, float(error), float(error / own.clamp_min(1e-12)))
        for name, unit, error, own in zip(body.targets, units, wrong, spread, strict=True)
    ]
    return pd.DataFrame(
        [*lines, *_horizons(model, pieces)], columns=["quantity", "horizon", "unit", "error", "share"]
    )


def _horizons(model: RobotModel, pieces: Pieces) -> list[tuple[str, int, str, float, float]]:
    """Lines of `evaluate` for open loop."""
    body, ahead = model.body, pieces.actions.shape[1] - WARM_UP
    if body.pose == "none" or ahead < 1:
        return []
    path, actual = pieces.rollout(model.predictor, WARM_UP, ahead, model.network.pixels), pieces.states[:, WARM_UP:]
    stays = actual[:, :1].expand_as(actual)
    both = [[one.square().mean(0).sqrt() for one in rollout_errors(some, actual, body)] for some in (path, stays)]
    names = (("position", "m"), ("heading", "rad"))
    return [
        (name, step + 1, unit, float(error[step]), float(error[step] / still[step].clamp_min(1e-12)))
        for (name, unit), error, still in zip(names, *both, strict=True)
        for step in range(ahead)
    ]


def predict(model: RobotModel, drive: Drives, topics: Sequence[str] = ()) -> pd.DataFrame:
    """What a model predicts of drives, each step from the recorded state before it; `topics` as of `fit`.

    Returns:
        A line a step: `drive`, `time` s, and each component of y as `predicted_...` and `actual_...`.
    """
    import pandas as pd

    body, lines = model.body, []
    for one in _drives(drive, body, topics, held=True):
        motion = cut([one], body, len(one.actions)).motion(model.network.pixels)
        with torch.inference_mode():
            predicted, _ = model.predictor("novice", motion.inputs, motion.maps)
        time = np.arange(1, len(one.actions) + 1) / body.rate
        values = {f"{kind}_{name.replace(' ', '_')}": part[0, :, number].numpy()
                  for kind, part in (("predicted", predicted), ("actual", motion.targets))
                  for number, name in enumerate(body.targets)}  # fmt: skip
        lines.append(pd.DataFrame({"drive": one.name, "time": time} | values))
    return pd.concat(lines, ignore_index=True)
