"""Fits of checked drives: windows, pretraining, training, and the model of it all."""

from __future__ import annotations

import contextlib
import math
import warnings
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from torch import Tensor

from ownrobot.fitting import learning
from ownrobot.fitting.learning import Settings
from ownrobot.fitting.model import Model
from ownrobot.fitting.splits import divided, session_order, train_test_split
from ownrobot.fitting.windows import common_length, cut
from ownrobot.methods.fine_tuning import Pretrained
from ownrobot.methods.registry import METHODS
from sidm.config import ConfigError, Notice
from sidm.drives import Drive, minutes_of
from sidm.learning.arithmetic import one_thread
from sidm.learning.dataset import Datasets, Windows, windows_of
from sidm.learning.stopping import CurvePoint
from sidm.learning.training import Trained
from sidm.learning.units import loss_weights, role_units
from sidm.progress import progress_bar
from sidm.settings import Network


class Data(NamedTuple):
    """What a method learns from: windows of both robots, of `steps` steps."""

    sets: Datasets
    network: Network
    steps: int
    settings: Settings
    seed: int

    @property
    def scale(self) -> Tensor | None:
        """Weights (Y,) of the loss's components; None: all 1."""
        units = role_units(learning.units_in(self.sets, self.network), "novice")
        return loss_weights(self.network.body("novice"), units)


def data_of(
    novice: Sequence[Drive],
    expert: Sequence[Drive] | None,
    settings: Settings,
    seed: int,
) -> Data:
    """Windows of drives, those of the novice split to learn from and to stop by."""
    steps = common_length(novice, *([expert] if expert else []))
    drives = divided(novice, steps)
    parts = train_test_split(drives, session_order(drives, seed))
    if not all(any(len(drive) >= steps for drive in part) for part in parts):
        long = divided([drive for drive in novice if len(drive) >= steps], steps)
        parts = train_test_split(long, session_order(long, seed))
    body = novice[0].body
    network = learning.network_for(settings, body, expert[0].body if expert else None)

    def windows(part: Sequence[Drive]) -> Windows:
        return windows_of(cut(part, steps, overlap=True), network.pixels)

    train, test = map(windows, parts)
    # `Model.evaluate` takes drives of its own: nothing is validated while training
    sets = Datasets(train, test, test.first(0), windows(expert) if expert else None)
    return Data(sets, network, steps, settings, seed)


def fit_drives(
    novice: Sequence[Drive],
    expert: Sequence[Drive] | None,
    method: str,
    settings: Settings,
    seed: int = 0,
    state: Path | None = None,
    progress: bool = False,
    device: str = "cpu",
    start: Pretrained | None = None,
    notify: bool = True,
) -> Model:
    """Fit drives whose body is known, with checked settings; arguments as of `fit`.

    `state` is the folder of unfinished trainings; `start` has pretrained weights, which
    are otherwise trained where the method needs them; `notify` says whether to warn of
    drives that are not learnt from.
    """
    used = expert if METHODS[method].needs_expert else None
    data = data_of(novice, used, settings, seed)
    if start is None:
        start = pretrained(data, method, state, progress, device)
    title = f"fitting {method}, at most"
    shown = progress and METHODS[method].fit == "gradients"
    with one_thread(), _progress(title, settings.training.max_samples, shown) as update:
        trained = learning.learn(
            method,
            *(data.sets, data.network, seed, settings, start),
            checkpoint=state and state / "training",
            progress=update,
            device=device,
        )
    _refuse_not_finite(method, trained)
    body, scale = novice[0].body, data.scale
    if scale is not None and not scale.any():
        raise ConfigError(
            f"nothing of body '{body.name}' varies by more than its sensors resolve; "
            "look at the units, or at 'resolution' in the body"
        )
    model = Model(
        predictor=trained.model.cpu().eval(),
        body=body,
        method=method,
        steps=data.steps,
        minutes=minutes_of([drive for drive in novice if len(drive) >= data.steps]),
        test_loss=float(trained.best_test_loss),
        network=data.network,
        scale=scale,
        target_mean=data.sets.train.targets.mean((0, 1)),
    )
    if notify:
        for text in _notes(model, novice, expert):
            warnings.warn(Notice(text), stacklevel=3)
    return model


def pretrained(
    data: Data,
    method: str,
    state: Path | None = None,
    progress: bool = False,
    device: str = "cpu",
) -> Pretrained | None:
    """Weights learnt from the expert that a method starts from; None if it has none."""
    if not METHODS[method].pretrained:
        return None
    title, samples = "pretraining, at most", data.settings.training.max_samples
    with one_thread(), _progress(title, samples, progress) as update:
        return learning.pretrain(
            method,
            *(data.sets, data.network, data.seed, data.settings),
            checkpoint=state and state / "pretraining",
            progress=update,
            device=device,
        )


def _refuse_not_finite(method: str, trained: Trained) -> None:
    tensors = trained.model.state_dict().values()
    broken = any(bool(tensor.isnan().any()) for tensor in tensors)
    if broken or not math.isfinite(trained.best_test_loss):
        raise ConfigError(
            f"{method} has numbers that are not finite: look at the drives for values "
            "that are far too large"
        )


@contextlib.contextmanager
def _progress(
    title: str, samples: int, shown: bool
) -> Iterator[Callable[[CurvePoint], None]]:
    """A function to call after each test of a training, which moves a progress bar."""
    with progress_bar(samples, title, "sample", shown, scaled=True) as bar:
        yield lambda tested: bar.update(max(0, tested.samples - bar.n))


def _notes(
    model: Model, novice: Sequence[Drive], expert: Sequence[Drive] | None
) -> Iterator[str]:
    """What the model does not learn from, a line each."""
    if expert is not None and not METHODS[model.method].needs_expert:
        yield f"{model.method} does not learn from the expert's drives"
    short = [drive for drive in novice if len(drive) < model.steps]
    if short:
        share = minutes_of(short) / minutes_of(novice)
        yield (
            f"{len(short)} of {len(novice)} drives, {share:.1%} of the motion, are "
            f"shorter than a window of {model.steps} steps: the model does not learn "
            "from them"
        )
    weights = [] if model.scale is None else model.scale.tolist()
    names = [n for n, w in zip(model.body.targets, weights, strict=False) if not w]
    if names:
        yield (
            f"of body '{model.body.name}', {', '.join(names)}: varies by less than the "
            "sensor resolves, and so has no weight in the loss; 'resolution' in the "
            "body says what a sensor resolves"
        )
