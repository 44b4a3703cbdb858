"""From drives to a model of the robot: `sidm.fit`, and several methods side by side: `sidm.compare`."""

from __future__ import annotations

import contextlib
import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
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
from sidm.fitting.settings import Settings, settings_with
from sidm.fitting.windows import (
    common_length,
    cut,
    hold_out,
    learn_and_test,
    session_order,
)
from sidm.learning.arithmetic import one_thread
from sidm.learning.losses import prediction_loss
from sidm.learning.stopping import Tested
from sidm.learning.units import loss_weights, units_for
from sidm.progress import progress_bar
from sidm.rivals.methods import METHODS
from sidm.settings import Network, Training

if TYPE_CHECKING:
    import pandas as pd

    from sidm.fitting.arguments import BodyLike, Drives

UNFINISHED = "unfinished"  # a folder in the model's, of the state to go on from
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
    seed: int = 0,
    out: str | Path | None = None,
    topics: Sequence[str] = (),
    progress: bool = False,
) -> Model:
    """Learn a robot from its drives, with another robot's if there are any.

    Args:
        novice: drives of the robot, as `sidm.simulate` and `sidm.read_drives` give
            them; or a file, a ROS bag or a folder of them, or several; or a pandas
            table.
        expert: drives of another robot, whose motion is cheaper.
        method: one of `sidm.rivals.methods.METHODS`; 'sidm' with an expert and
            'novice_only' without one by default.
        body: what the novice's drives are made of, where they come from files: a body,
            its YAML file or a mapping.
        expert_body: what the expert's drives are made of; as the novice's unless given.
        network: sizes of the networks; the robots' bodies are put in.
        training: settings of the training, in place of what each method was tuned to.
        settings: single settings of both by name, as `{"hidden": 64, "p_expert": 0.5}`.
        seed: of the choice of drives to stop by, the initial weights and the batches.
        out: a folder for the model; it also keeps an unfinished training, which the
            same call goes on with.
        topics: of ROS bags that are read, where several could be meant.
        progress: whether to show it, with the time left at most.

    Returns:
        The model, written to `out` if given.

    Raises:
        RecordingError: the first fault of a file of drives.
        ConfigError: a body, a method or a setting that these robots cannot be learnt
            with.
        TypeError: something else than drives.

    Examples:
        >>> drives = sidm.read_drives("recordings/warthog.csv.gz", body="recordings/skid_steer.yaml")
        >>> model = sidm.fit(drives[:200], method="least_squares")
        >>> model
        Model('least_squares' of body 'skid-steered', from 6.3 min)
        >>> round(model.loss(drives[200:]), 1) < 1.0
        True
    """
    chosen = settings_with(network, training, settings)
    if seed < 0:
        raise ConfigError(f"seed must be 0 or more, not {seed}")
    if expert is None and expert_body is not None:
        raise ConfigError(
            "expert_body says what an expert's drives are made of, but there is no expert"
        )
    own = drives_from(novice, body, "novice", topics)
    other = (
        None
        if expert is None
        else drives_from(expert, expert_body, "expert", topics, otherwise=body)
    )
    method = method or ("novice_only" if other is None else "sidm")
    refuse_method(method, own[0].body, None if other is None else other[0].body)
    refuse_swapped(own, other)
    model = _fit(own, other, method, chosen, seed, out, progress)
    if out is not None:
        model.save(out)
        shutil.rmtree(Path(out) / UNFINISHED, ignore_errors=True)
    return model


def _fit(
    own: Sequence[Drive],
    other: Sequence[Drive] | None,
    method: str,
    chosen: Settings,
    seed: int,
    out: str | Path | None,
    progress: bool,
) -> Model:
    """`fit` of drives that were read, by settings that were made."""
    steps = common_length(own, *([other] if other else []))
    windows = cut(own, steps)
    parts = learn_and_test(windows, session_order(windows, seed))
    body = own[0].body
    network = network_for(chosen, body, other[0].body if other else None)
    sets = datasets(
        *parts, parts[1], cut(other, steps) if other else None, network.pixels
    )
    state = None if out is None else Path(out) / UNFINISHED
    folders = [state / name if state else None for name in ("pretraining", "training")]
    most, chosen_method = chosen.training.max_samples, METHODS[method]
    with one_thread():
        with _watched(
            "pretraining, at most", most, progress and chosen_method.pretrained
        ) as tell:
            start = pretrain(
                method, sets, network, seed, chosen, folder=folders[0], progress=tell
            )
        with _watched(
            f"fitting {method}, at most",
            most,
            progress and chosen_method.fit == "gradients",
        ) as tell:
            trained = learn(
                method,
                sets,
                network,
                seed,
                chosen,
                start=start,
                folder=folders[1],
                progress=tell,
            )
    scale, targets = (
        loss_weights(body, units_for(units_in(sets, network), "novice")),
        sets.test.targets,
    )
    mean = prediction_loss(
        sets.train.targets.mean((0, 1)).expand_as(targets), targets, scale
    ).mean()
    minutes, best = minutes_of(windows), float(trained.best_test_loss)
    return Model(
        trained.model.eval(),
        body,
        method,
        steps,
        minutes,
        best,
        network,
        scale,
        float(mean),
    )


@contextlib.contextmanager
def _watched(title: str, most: int, shown: bool) -> Iterator[Callable[[Tested], None]]:
    """What a training of at most so many samples is to call after each test."""
    with progress_bar(most, title, "sample", shown, scaled=True) as bar:
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
    """Fit several methods to the same drives, and judge each by the same drives that none has learnt from.

    Args:
        novice: as of `fit`.
        expert: as of `fit`.
        methods: names as of `fit`; by default least squares, the novice alone, and with
            an expert an SIDM.
        body: as of `fit`.
        expert_body: as of `fit`.
        share: of the novice's steps that judge, at most: the last sessions, and the
            very last in any case.
        seed: as of `fit`.
        settings: as of `fit`.
        progress: whether to show it.

    Returns:
        A line a method, the best first: `loss` on the held-out drives, a step; and the
        `position` error, m, and the `heading` error, rad, at the end of an open-loop
        prediction, where the body has a pose.

    Raises:
        ConfigError: as of `fit`, or a single drive.

    Examples:
        >>> drives = sidm.read_drives("recordings/warthog.csv.gz", body="recordings/skid_steer.yaml")
        >>> table = sidm.compare(drives, methods=["least_squares"])
        >>> list(table.columns)
        ['method', 'loss', 'position', 'heading']
    """
    import pandas as pd

    own = drives_from(novice, body, "novice")
    other = (
        None
        if expert is None
        else drives_from(expert, expert_body, "expert", otherwise=body)
    )
    methods = [methods] if isinstance(methods, str) else methods
    methods = methods or ("least_squares", "novice_only", *(("sidm",) if other else ()))
    for method in methods:
        refuse_method(method, own[0].body, None if other is None else other[0].body)
    learning, judging = hold_out(own, share)
    lines = []
    for method in methods:
        model = fit(
            learning, other, method, settings=settings, seed=seed, progress=progress
        )
        table = model.evaluate(judging)
        last = {
            name: table[table.quantity == name].error
            for name in ("position", "heading")
        }
        lines.append(
            {"method": method, "loss": model.loss(judging)}
            | {name: errors.iloc[-1] for name, errors in last.items() if len(errors)}
        )
    return pd.DataFrame(lines).sort_values("loss", ignore_index=True)
