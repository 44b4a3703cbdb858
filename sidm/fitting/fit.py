"""Fit a model to drives (`sidm.fit`), and compare several methods (`sidm.compare`)."""

from __future__ import annotations

import contextlib
import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from sidm.config import ConfigError
from sidm.drives import Drive, minutes_of
from sidm.fitting.arguments import drives_from, refuse_swapped
from sidm.fitting.learning import (
    datasets,
    learn,
    network_for,
    pretrain,
    refuse_method,
    units_in,
)
from sidm.fitting.model import Model
from sidm.fitting.score import WindowLosses
from sidm.fitting.settings import Settings, settings_with
from sidm.fitting.windows import (
    common_length,
    cut,
    evaluation_splits,
    hold_out,
    session_order,
    train_test_split,
)
from sidm.learning.arithmetic import one_thread
from sidm.learning.stopping import CurvePoint
from sidm.learning.units import loss_weights, role_units
from sidm.progress import progress_bar
from sidm.rivals.methods import METHODS
from sidm.settings import Network, Training

if TYPE_CHECKING:
    import pandas as pd

    from sidm.fitting.arguments import BodyLike, Drives

UNFINISHED = "unfinished"  # subfolder of the model's, for the state of a training
NOTHING: Mapping[str, Any] = MappingProxyType({})


def fit(
    novice: Drives,
    expert: Drives | None = None,
    method: str | None = None,
    *,
    body: BodyLike | None = None,
    expert_body: BodyLike | None = None,
    network: Network | None = None,
    training: Training | None = None,
    settings: Mapping[str, Any] = NOTHING,
    test: Drives | float | None = None,
    seed: int = 0,
    out: str | Path | None = None,
    topics: Sequence[str] = (),
    progress: bool = False,
) -> Model:
    """Fit a model of a robot to its drives, and to an expert's drives if there are any.

    Args:
        novice: drives of the robot, as `sidm.simulate` and `sidm.read_drives` return
            them; or a file, a ROS bag or a folder of drives, or several; or a pandas
            table.
        expert: drives of another robot, whose motion is cheaper to record.
        method: a name in `sidm.rivals.methods.METHODS`; by default 'sidm' with an
            expert and 'novice_only' without one.
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
        topics: topics of ROS bags, needed if a bag has several matching topics.
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
    novice_drives = drives_from(novice, body, "novice", topics)
    expert_drives = None
    if expert is not None:
        expert_drives = drives_from(
            expert, expert_body, "expert", topics, default_body=body
        )
    method = method or ("novice_only" if expert_drives is None else "sidm")
    _refuse(method, novice_drives, expert_drives)
    refuse_swapped(novice_drives, expert_drives)
    learnt, held_out, folds = _split(novice_drives, test, seed, topics)
    state = None if out is None else Path(out) / UNFINISHED
    others = expert_drives, method, chosen, seed
    model = _fit(learnt, *others, state, progress)
    losses = [model.losses(held_out)] if held_out else []
    for number, (drives, rest) in enumerate(folds):
        folder = state and state / f"fold{number}"
        losses.append(_fit(drives, *others, folder, progress).losses(rest))
    if losses:
        model = replace(model, held_out=WindowLosses.joined(losses).score(len(losses)))
    if out is not None:
        model.save(out)
        shutil.rmtree(Path(out) / UNFINISHED, ignore_errors=True)
    return model


def _split(
    novice: list[Drive],
    test: Drives | float | None,
    seed: int,
    topics: Sequence[str],
) -> tuple[list[Drive], list[Drive], list[tuple[list[Drive], list[Drive]]]]:
    """The drives to learn from, the drives to evaluate on, and splits of folds."""
    if test is None:
        return novice, [], []
    if not isinstance(test, (int, float)):
        body = novice[0].body
        held_out = drives_from(test, body, "test", topics, allow_constant=True)
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


def _refuse(
    method: str, novice: Sequence[Drive], expert: Sequence[Drive] | None
) -> None:
    """Raise ConfigError for a method that cannot learn the robots of these drives."""
    refuse_method(method, novice[0].body, None if expert is None else expert[0].body)


def _fit(
    novice: Sequence[Drive],
    expert: Sequence[Drive] | None,
    method: str,
    settings: Settings,
    seed: int,
    state: Path | None,
    progress: bool,
) -> Model:
    """Fit checked drives with checked settings; `state` is for unfinished trainings."""
    steps = common_length(novice, *([expert] if expert else []))
    windows = cut(novice, steps)
    train, test = train_test_split(windows, session_order(windows, seed))
    body = novice[0].body
    network = network_for(settings, body, expert[0].body if expert else None)
    expert_windows = cut(expert, steps) if expert else None
    # There is no validation here: `Model.evaluate` takes drives of its own.
    sets = datasets(train, test, test, expert_windows, network.pixels)
    folders = [state / name if state else None for name in ("pretraining", "training")]
    samples, config = settings.training.max_samples, METHODS[method]
    arguments = (method, sets, network, seed, settings)
    with one_thread():
        title, shown = "pretraining, at most", progress and config.pretrained
        with _progress(title, samples, shown) as update:
            start = pretrain(*arguments, folder=folders[0], progress=update)
        title = f"fitting {method}, at most"
        shown = progress and config.fit == "gradients"
        with _progress(title, samples, shown) as update:
            trained = learn(*arguments, start=start, folder=folders[1], progress=update)
    scale = loss_weights(body, role_units(units_in(sets, network), "novice"))
    return Model(
        predictor=trained.model.eval(),
        body=body,
        method=method,
        steps=steps,
        minutes=minutes_of(windows),
        test_loss=float(trained.best_test_loss),
        network=network,
        scale=scale,
        target_mean=sets.train.targets.mean((0, 1)),
    )


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


def compare(
    novice: Drives,
    expert: Drives | None = None,
    methods: Sequence[str] = (),
    *,
    body: BodyLike | None = None,
    expert_body: BodyLike | None = None,
    share: float = 0.25,
    seed: int = 0,
    settings: Mapping[str, Any] = NOTHING,
    progress: bool = False,
) -> pd.DataFrame:
    """Fit several methods to the same drives and evaluate them on held-out drives.

    Args:
        novice: drives of the robot, as in `fit`.
        expert: drives of another robot, as in `fit`.
        methods: names of methods, as in `fit`; by default 'least_squares',
            'novice_only' and, with an expert, 'sidm'.
        body: what the novice's drives are made of, as in `fit`.
        expert_body: what the expert's drives are made of, as in `fit`.
        share: largest share of the novice's steps to hold out. The last sessions are
            held out, and at least the very last one.
        seed: seed of a training, as in `fit`.
        settings: single settings by name, as in `fit`.
        progress: whether to show progress bars.

    Returns:
        A row for each method, the best first, with `loss`, the mean loss of a step of
        the held-out drives. For a body with a pose, `position` (m) and `heading` (rad)
        are the errors at the end of an open-loop prediction.

    Raises:
        ConfigError: an argument has a fault, as in `fit`, or there is a single drive.

    Examples:
        >>> drives = sidm.read_drives(
        ...     "recordings/warthog.csv.gz", body="recordings/skid_steer.yaml"
        ... )
        >>> table = sidm.compare(drives, methods=["least_squares"])
        >>> list(table.columns)
        ['method', 'loss', 'position', 'heading']
    """
    import pandas as pd

    novice_drives = drives_from(novice, body, "novice")
    expert_drives = None
    if expert is not None:
        expert_drives = drives_from(expert, expert_body, "expert", default_body=body)
    methods = [methods] if isinstance(methods, str) else methods
    if not methods:
        methods = ["least_squares", "novice_only", *(["sidm"] if expert_drives else [])]
    for method in methods:
        _refuse(method, novice_drives, expert_drives)
    learning, held_out = hold_out(novice_drives, share)
    rows = []
    for method in methods:
        model = fit(
            learning,
            expert_drives,
            method,
            settings=settings,
            seed=seed,
            progress=progress,
        )
        row = {"method": method, "loss": model.loss(held_out)}
        table = model.evaluate(held_out)
        for name in ("position", "heading"):
            errors = table[table.quantity == name].error
            if len(errors):
                row[name] = errors.iloc[-1]
        rows.append(row)
    return pd.DataFrame(rows).sort_values("loss", ignore_index=True)
