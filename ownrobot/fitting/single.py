"""Fits of checked drives: windows, pretraining, training, and the model of it all."""

from __future__ import annotations

import contextlib
import math
import warnings
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from torch import Tensor

from ownrobot.fitting.learning import (
    datasets,
    learn,
    network_for,
    pretrain,
    units_in,
)
from ownrobot.fitting.model import Model
from ownrobot.fitting.settings import Settings
from ownrobot.fitting.splits import divided, session_order, train_test_split
from ownrobot.fitting.windows import common_length, cut
from ownrobot.methods.fine_tuning import Pretrained
from ownrobot.methods.registry import METHODS
from sidm.config import ConfigError, Notice
from sidm.drives import Drive, minutes_of
from sidm.learning.arithmetic import one_thread
from sidm.learning.dataset import Datasets
from sidm.learning.stopping import CurvePoint
from sidm.learning.training import Trained
from sidm.learning.units import loss_weights, role_units
from sidm.progress import progress_bar
from sidm.settings import Network


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
    sets, network, steps = _datasets(novice, expert, settings, seed)
    if start is None:
        how = seed, state, progress, device
        start = pretrained(novice, expert, method, settings, *how)
    title = f"fitting {method}, at most"
    shown = progress and METHODS[method].fit == "gradients"
    samples = settings.training.max_samples
    with one_thread(), _progress(title, samples, shown) as update:
        trained = learn(
            method,
            sets,
            network,
            seed,
            settings,
            start=start,
            folder=state and state / "training",
            progress=update,
            device=device,
        )
    _refuse_not_finite(method, trained)
    body = novice[0].body
    scale = _scale(sets, network)
    if scale is not None and not scale.any():
        raise ConfigError(
            f"nothing of body '{body.name}' varies by more than its sensors resolve; "
            "look at the units, or at 'resolution' in the body"
        )
    model = Model(
        predictor=trained.model.cpu().eval(),
        body=body,
        method=method,
        steps=steps,
        minutes=minutes_of([drive for drive in novice if len(drive) >= steps]),
        test_loss=float(trained.best_test_loss),
        network=network,
        scale=scale,
        target_mean=sets.train.targets.mean((0, 1)),
    )
    if notify:
        _notify(model, novice, expert)
    return model


def pretrained(
    novice: Sequence[Drive],
    expert: Sequence[Drive] | None,
    method: str,
    settings: Settings,
    seed: int = 0,
    state: Path | None = None,
    progress: bool = False,
    device: str = "cpu",
) -> Pretrained | None:
    """Weights learnt from the expert that a method starts from; None if it has none.

    The arguments are those of `fit_drives`. Of the novice, the length of windows and
    the body count.
    """
    config = METHODS[method]
    if not config.pretrained:
        return None
    sets, network, _ = _datasets(novice, expert, settings, seed)
    title, samples = "pretraining, at most", settings.training.max_samples
    with one_thread(), _progress(title, samples, progress) as update:
        return pretrain(
            method,
            sets,
            network,
            seed,
            settings,
            folder=state and state / "pretraining",
            progress=update,
            device=device,
        )


def loss_scale(
    novice: Sequence[Drive],
    expert: Sequence[Drive] | None,
    settings: Settings,
    seed: int = 0,
) -> Tensor | None:
    """Weights (Y,) of the loss's components for a model of these drives; None: all 1.

    The arguments are those of `fit_drives`.
    """
    sets, network, _ = _datasets(novice, expert, settings, seed)
    return _scale(sets, network)


def _scale(sets: Datasets, network: Network) -> Tensor | None:
    units = role_units(units_in(sets, network), "novice")
    return loss_weights(network.body("novice"), units)


def _refuse_not_finite(method: str, trained: Trained) -> None:
    """Raise ConfigError for a model with a weight or a loss that is not finite."""
    tensors = trained.model.state_dict().values()
    broken = any(bool(tensor.isnan().any()) for tensor in tensors)
    if broken or not math.isfinite(trained.best_test_loss):
        raise ConfigError(
            f"{method} has numbers that are not finite: look at the drives for values "
            "that are far too large"
        )


def _datasets(
    novice: Sequence[Drive],
    expert: Sequence[Drive] | None,
    settings: Settings,
    seed: int,
) -> tuple[Datasets, Network, int]:
    """Windows of both robots, the networks for them, and the windows' length."""
    steps = common_length(novice, *([expert] if expert else []))
    train, test = (
        cut(part, steps, overlap=True)
        for part in _learnt_and_test(divided(novice, steps), steps, seed)
    )
    body = novice[0].body
    network = network_for(settings, body, expert[0].body if expert else None)
    expert_windows = cut(expert, steps, overlap=True) if expert else None
    sets = datasets(train, test, test, expert_windows, network.pixels)
    # `Model.evaluate` takes drives of its own: nothing is validated while training
    return sets._replace(validation=sets.test.first(0)), network, steps


def _learnt_and_test(
    drives: Sequence[Drive], steps: int, seed: int
) -> tuple[list[Drive], list[Drive]]:
    """Drives to learn from and drives to stop by; each part has a window."""
    parts = train_test_split(drives, session_order(drives, seed))
    if all(any(len(drive) >= steps for drive in part) for part in parts):
        return parts
    long = [drive for drive in drives if len(drive) >= steps]
    return train_test_split(long, session_order(long, seed))


@contextlib.contextmanager
def _progress(
    title: str, samples: int, shown: bool
) -> Iterator[Callable[[CurvePoint], None]]:
    """A function to call after each test of a training, which moves a progress bar."""
    with progress_bar(samples, title, "sample", shown, scaled=True) as bar:
        yield lambda tested: bar.update(max(0, tested.samples - bar.n))


def _notify(
    model: Model, novice: Sequence[Drive], expert: Sequence[Drive] | None
) -> None:
    """Warn of what the model does not learn from, with a `Notice` each."""
    method = METHODS[model.method]
    if expert is not None and not method.needs_expert:
        warnings.warn(
            Notice(f"{model.method} does not learn from the expert's drives"),
            stacklevel=4,
        )
    short = [drive for drive in novice if len(drive) < model.steps]
    if short:
        share = minutes_of(short) / minutes_of(novice)
        text = (
            f"{len(short)} of {len(novice)} drives, {share:.1%} of the motion, are "
            f"shorter than a window of {model.steps} steps: the model does not learn "
            "from them"
        )
        warnings.warn(Notice(text), stacklevel=4)
    if model.scale is None:
        return
    names = [n for n, w in zip(model.body.targets, model.scale, strict=True) if not w]
    if names:
        text = (
            f"of body '{model.body.name}', {', '.join(names)}: varies by less than the "
            "sensor resolves, and so has no weight in the loss; 'resolution' in the "
            "body says what a sensor resolves"
        )
        warnings.warn(Notice(text), stacklevel=4)
