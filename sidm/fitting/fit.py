"""Fit a model to drives (`sidm.fit`)."""

from __future__ import annotations

import contextlib
import shutil
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from sidm.config import ConfigError, Notice
from sidm.drives import Drive, minutes_of
from sidm.fitting.arguments import drives_from, refuse_swapped
from sidm.fitting.files import refuse_folder
from sidm.fitting.learning import (
    datasets,
    learn,
    network_for,
    pretrain,
    refuse_method,
    units_in,
)
from sidm.fitting.model import Model
from sidm.fitting.score import DriveLosses
from sidm.fitting.settings import Settings, settings_with
from sidm.fitting.splits import (
    Split,
    divided,
    evaluation_splits,
    session_order,
    train_test_split,
)
from sidm.fitting.windows import common_length, cut
from sidm.learning.arithmetic import one_thread
from sidm.learning.stopping import CurvePoint
from sidm.learning.units import loss_weights, role_units
from sidm.progress import progress_bar
from sidm.rivals.methods import METHODS
from sidm.settings import Network, Training

if TYPE_CHECKING:
    from sidm.fitting.arguments import BodyLike, Drives
    from sidm.learning.dataset import Datasets
    from sidm.rivals.fine_tuning import Pretrained

UNFINISHED = "unfinished"  # subfolder of the model's, for the state of a training
NOTHING: Mapping[str, Any] = MappingProxyType({})


def fit(
    novice: Drives,
    expert: Drives | None = None,
    method: str = "least_squares",
    *,
    body: BodyLike | None = None,
    expert_body: BodyLike | None = None,
    network: Network | None = None,
    training: Training | None = None,
    settings: Mapping[str, Any] = NOTHING,
    test: Drives | float | None = None,
    seed: int = 0,
    out: str | Path | None = None,
    force: bool = False,
    topics: Sequence[str] = (),
    skip_bad: bool = False,
    progress: bool = False,
) -> Model:
    """Fit a model of a robot to its drives, and to an expert's drives if there are any.

    Args:
        novice: drives of the robot, as `sidm.simulate` and `sidm.read_drives` return
            them; or a file, a ROS bag or a folder of drives, or several; or a pandas
            table.
        expert: drives of another robot, whose motion is cheaper to record.
        method: a name in `sidm.rivals.methods.METHODS`.
        body: what the novice's drives are made of, needed where they come from files: a
            body, its YAML file or a mapping.
        expert_body: what the expert's drives are made of; by default `body`.
        network: sizes of the networks; the robots' bodies are put in.
        training: settings of the training; they replace the tuned values of the
            methods.
        settings: single settings of network and training by name, as
            `{"hidden": 64, "p_expert": 0.5}`.
        test: drives of the robot to evaluate the model on; or a share of the novice's
            sessions to hold out for that, below 1. With fewer than eight sessions (or
            drives, of a single session), models of folds are evaluated instead, and the
            model learns from all drives. By default nothing is held out.
        seed: seed of the choice of drives, the initial weights and the batches.
        out: a folder for the model. An unfinished training is kept there, too; the same
            call resumes it.
        force: whether the model may replace another robot's model in `out`.
        topics: topics of ROS bags, needed if a bag has several matching topics.
        skip_bad: whether to leave out drives that have a fault, with a `Notice` each.
        progress: whether to show a progress bar, with the longest time left.

    Returns:
        The model. It is also written to `out` if a folder is given. `held_out` is its
        loss on the drives of `test`; None without any, or with too few.

    Raises:
        RecordingError: the first fault of a file of drives.
        ConfigError: these robots cannot be learnt with the body, the method or a
            setting.
        TypeError: `novice` or `expert` is nothing that holds drives.

    Examples:
        >>> drives = sidm.read_drives(
        ...     "recordings/warthog.csv.gz", body="recordings/skid_steer.yaml"
        ... )
        >>> model = sidm.fit(drives, method="least_squares", test=0.25)
        >>> model
        Model('least_squares' of body 'skid-steered', from 6.8 min)
        >>> model.held_out.sessions
        24
    """
    chosen = settings_with(network, training, settings)
    if seed < 0:
        raise ConfigError(f"seed must be 0 or more, not {seed}")
    if expert is None and expert_body is not None:
        raise ConfigError("expert_body is given, but there is no expert")
    reading: dict[str, Any] = {"topics": topics, "skip_bad": skip_bad}
    novice_drives = drives_from(novice, body, "novice", **reading)
    expert_drives = None
    if expert is not None:
        expert_drives = drives_from(
            expert, expert_body, "expert", default_body=body, **reading
        )
    _refuse(method, novice_drives, expert_drives)
    refuse_swapped(novice_drives, expert_drives)
    if out is not None:
        refuse_folder(out, novice_drives[0].body, force)
    learnt, held_out, folds = _split(novice_drives, test, seed, reading)
    state = None if out is None else Path(out) / UNFINISHED
    others = expert_drives, method, chosen, seed
    model = fit_drives(learnt, *others, state, progress)
    losses = [model.losses(held_out)] if held_out else []
    for number, (drives, rest) in enumerate(folds):
        folder = state and state / f"fold{number}"
        part = fit_drives(drives, *others, folder, progress, notify=False)
        losses.append(part.losses(rest))
    if losses:
        model = replace(model, held_out=DriveLosses.joined(losses).score(len(losses)))
    if out is not None:
        model.save(out, force=force)
        shutil.rmtree(Path(out) / UNFINISHED, ignore_errors=True)
    return model


def _split(
    novice: list[Drive],
    test: Drives | float | None,
    seed: int,
    reading: Mapping[str, Any],
) -> tuple[list[Drive], list[Drive], list[Split]]:
    """The drives to learn from, the drives to evaluate on, and splits of folds."""
    if test is None:
        return novice, [], []
    if not isinstance(test, (int, float)):
        body = novice[0].body
        held_out = drives_from(test, body, "test", allow_constant=True, **reading)
        learnt = {drive.states.tobytes() for drive in novice}
        for drive in held_out:
            if drive.states.tobytes() in learnt:
                raise ConfigError(
                    f"test has {drive.name}, which the model learns from; "
                    "pass other drives, or a share"
                )
        return novice, held_out, []
    if not 0 < test < 1:
        raise ConfigError(f"test must be drives or a share below 1, not {test}")
    splits = evaluation_splits(novice, test, seed)
    if len(splits) == 1:
        return *splits[0], []
    return novice, [], splits


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
            f"{', '.join(names)} of body '{model.body.name}' varies by less than its "
            "sensor resolves: it has no weight in the loss; 'resolution' in the body "
            "says what a sensor resolves"
        )
        warnings.warn(Notice(text), stacklevel=4)


def _refuse(
    method: str, novice: Sequence[Drive], expert: Sequence[Drive] | None
) -> None:
    """Raise ConfigError for a method that cannot learn the robots of these drives."""
    refuse_method(method, novice[0].body, None if expert is None else expert[0].body)


def fit_drives(
    novice: Sequence[Drive],
    expert: Sequence[Drive] | None,
    method: str,
    settings: Settings,
    seed: int = 0,
    state: Path | None = None,
    progress: bool = False,
    start: Pretrained | None = None,
    notify: bool = True,
) -> Model:
    """Fit drives whose body is known, with checked settings.

    Args:
        novice: drives of the robot.
        expert: drives of the expert, if there are any.
        method: a name in METHODS that can learn these robots.
        settings: networks and training.
        seed: as in `fit`.
        state: folder of unfinished trainings.
        progress: as in `fit`.
        start: pretrained weights; by default they are trained where the method needs
            them.
        notify: whether to warn of drives that are not learnt from.

    Raises:
        ConfigError: too few drives.
    """
    sets, network, steps = _datasets(novice, expert, settings, seed)
    if start is None:
        start = pretrained(novice, expert, method, settings, seed, state, progress)
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
        )
    body = novice[0].body
    scale = loss_weights(body, role_units(units_in(sets, network), "novice"))
    model = Model(
        predictor=trained.model.eval(),
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
        )


def _datasets(
    novice: Sequence[Drive],
    expert: Sequence[Drive] | None,
    settings: Settings,
    seed: int,
) -> tuple[Datasets, Network, int]:
    """Windows of both robots, the networks for them, and the windows' length."""
    steps = common_length(novice, *([expert] if expert else []))
    drives = divided(novice, steps)
    train, test = (
        cut(part, steps, overlap=True)
        for part in train_test_split(drives, session_order(drives, seed))
    )
    body = novice[0].body
    network = network_for(settings, body, expert[0].body if expert else None)
    expert_windows = cut(expert, steps, overlap=True) if expert else None
    # There is no validation here: `Model.evaluate` takes drives of its own.
    sets = datasets(train, test, test, expert_windows, network.pixels)
    return sets, network, steps


@contextlib.contextmanager
def _progress(
    title: str, samples: int, shown: bool
) -> Iterator[Callable[[CurvePoint], None]]:
    """A function to call after each test of a training, which moves a progress bar.

    Args:
        title: text beside the bar.
        samples: the most that the training takes, the bar's end.
        shown: whether there is a bar.
    """
    with progress_bar(samples, title, "sample", shown, scaled=True) as bar:
        yield lambda tested: bar.update(max(0, tested.samples - bar.n))
