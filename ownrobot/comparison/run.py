"""Compare methods on a robot's drives (`ownrobot.compare`)."""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import hashlib
import json
import time
import warnings
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

import ownrobot
import sidm
from ownrobot.comparison.plan import (
    FOLDS,
    REPEATS,
    SHARES,
    Fit,
    Plan,
    drives_of,
    plan_for,
)
from ownrobot.comparison.result import Comparison, FitResult
from ownrobot.comparison.store import read_result, write_result
from ownrobot.fitting.arguments import robots_from
from ownrobot.fitting.settings import Settings, settings_with, without_effect
from ownrobot.fitting.single import fit_drives, loss_scale, pretrained
from ownrobot.fitting.windows import common_length, ground_key
from ownrobot.methods.registry import METHODS
from sidm.config import ConfigError, Notice, first_line, replace, to_mapping
from sidm.drives import Drive, minutes_of
from sidm.learning.arithmetic import one_thread
from sidm.learning.stopping import TrainingError
from sidm.pool import as_completed, local_pool
from sidm.progress import progress_bar
from sidm.settings import Network, Training
from sidm.storage import checksum, write_record
from sidm.versions import library_versions, source_digest

if TYPE_CHECKING:
    from ownrobot.fitting.arguments import BodyLike, Drives
    from ownrobot.methods.fine_tuning import Pretrained


class Task(NamedTuple):
    """All that the fits of a comparison need.

    Attributes:
        plan: sizes of the comparison
        novice: drives of the robot
        expert: drives of the expert, if there are any
        settings: networks and training
        folder: where results are kept; None: nowhere
    """

    plan: Plan
    novice: list[Drive]
    expert: list[Drive] | None
    settings: Settings
    folder: Path | None


def compare(
    novice: Drives,
    expert: Drives | None = None,
    methods: Sequence[str] = (),
    *,
    body: BodyLike | None = None,
    expert_body: BodyLike | None = None,
    network: Network | None = None,
    training: Training | None = None,
    settings: Mapping[str, Any] = MappingProxyType({}),
    folds: int = FOLDS,
    repeats: int = REPEATS,
    shares: Sequence[float] = SHARES,
    seed: int = 0,
    folder: str | Path | None = None,
    workers: int = 1,
    topics: Sequence[str] = (),
    skip_bad: bool = False,
    progress: bool = True,
) -> Comparison:
    """Compare methods of learning a robot by cross-validation over its sessions.

    In each repeat the sessions are divided into folds. Each method learns from all
    sessions but those of a fold, and is evaluated on these; windows of one session are
    never on both sides. Of a single session, drives take the place of sessions.

    Arguments that `fit` has, too, mean the same here. By default the `methods` are
    those of `plan.DEFAULT_METHODS` that can learn these robots, and there are as many
    `folds` as sessions at most. Other `repeats` have other seeds, from `seed` on. A
    learning curve has `shares` of the sessions to learn from, and all of them. A
    `folder` keeps the results of fits, so that the same call goes on where it was. With
    more than one of the `workers`, processes that fit at the same time, a script's call
    must stand under `if __name__ == "__main__":`.

    Returns:
        The comparison: its `table`, its learning `curve`, its `verdict`.

    Raises:
        ConfigError: an argument has a fault, as in `fit`; there is a single drive; or
            no method could be fitted.

    Examples:
        >>> drives = ownrobot.read_drives(
        ...     "recordings/warthog.csv.gz", body="recordings/skid_steer.yaml"
        ... )
        >>> comparison = ownrobot.compare(
        ...     drives, methods=["mean", "least_squares"], repeats=1, shares=[1]
        ... )
        >>> comparison.table.method.tolist()
        ['least_squares', 'mean']
        >>> bool(comparison.ratio("least_squares", "mean").high < 1)
        True
    """
    with _noted() as notices:
        novice_drives, expert_drives = robots_from(
            novice, expert, body, expert_body, topics=topics, skip_bad=skip_bad
        )
    if workers < 1:
        raise ConfigError(f"workers must be at least 1, not {workers}")
    methods = [methods] if isinstance(methods, str) else methods
    sizes = folds, repeats, shares, seed
    novice_drives = _named(novice_drives)
    plan = plan_for(novice_drives, expert_drives, methods, *sizes)
    if plan.repeats < repeats:
        parts = f"{plan.folds} sessions or drives"
        text = f"{parts} can be held out in one way: 1 repeat, not {repeats}"
        _notice(text, notices)
    if expert and not any(METHODS[name].needs_expert for name in plan.methods):
        _notice("none of the methods learns from the expert's drives", notices)
    _notice(without_effect(plan.methods, settings, novice_drives[0].body), notices)
    chosen = settings_with(network, training, settings)
    kept = None if folder is None else Path(folder)
    task = Task(plan, novice_drives, expert_drives, chosen, kept)
    results, faults = [], []
    fits = plan.fits()
    with progress_bar(len(fits), "comparing", "fit", progress) as bar:
        for outcome in _outcomes(task, fits, workers):
            if isinstance(outcome, str):
                faults.append(outcome)
            else:
                results.append(outcome)
            bar.update()
    faults = sorted(set(faults))
    for fault in faults:
        warnings.warn(Notice(fault), stacklevel=2)
    comparison = Comparison(plan, results, (*notices, *faults), novice_drives)
    if not comparison.methods:
        raise ConfigError(faults[0])
    return comparison


def _notice(text: str, notices: list[str]) -> None:
    """Warn of a text that is not empty, and keep it for the report."""
    if text:
        warnings.warn(Notice(text), stacklevel=3)
        notices.append(text)


def _named(drives: list[Drive]) -> list[Drive]:
    """Drives with names that differ: numbers are added where names are alike."""
    if len({drive.name for drive in drives}) == len(drives):
        return drives
    return [
        replace(drive, name=f"{drive.name} {number}".strip())
        for number, drive in enumerate(drives)
    ]


@contextlib.contextmanager
def _noted() -> Iterator[list[str]]:
    """Collect the texts of notices in the block, which are shown all the same."""
    texts: list[str] = []
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", Notice)
        yield texts
    for warning in caught:
        if issubclass(warning.category, Notice):
            texts.append(str(warning.message))
        warnings.warn_explicit(
            warning.message, warning.category, warning.filename, warning.lineno
        )


def _outcomes(
    task: Task, fits: Sequence[Fit], workers: int
) -> Iterator[FitResult | str]:
    """The result of each fit, or the fault that it had, as they come."""
    with local_pool(workers) as pool:
        futures = [pool.submit(outcome_of, task, fit) for fit in fits]
        for future in as_completed(futures):
            yield future.result()


def outcome_of(task: Task, fit: Fit) -> FitResult | str:
    """The result of a fit, or the line of the fault that it had; kept in the folder."""
    path = None
    if task.folder is not None:
        path = task.folder / "fits" / f"{key_of(task, fit)}.json"
        stored = read_result(path, fit)
        if isinstance(stored, FitResult):
            return _renamed(task, stored)
        if stored is not None:
            return stored
    try:
        result = _fitted(task, fit)
    except (ConfigError, TrainingError) as error:
        fault = f"{fit.method} with {fit.share:.0%} of the data: {first_line(error)}"
        if path:
            write_record(path, {"fault": fault})
        return fault
    if path:
        write_result(path, result)
    return result


def _renamed(task: Task, result: FitResult) -> FitResult:
    """A stored result with the drives' names of today: files may have moved."""
    held_out = drives_of(task.plan, result.fit, task.novice).held_out
    names = np.array([drive.name for drive in held_out])
    worst = str(names[result.losses.losses.argmax()])
    return result._replace(losses=result.losses._replace(drives=names), worst=worst)


def _fitted(task: Task, fit: Fit) -> FitResult:
    """Fit a method and evaluate it on the drives that are held out.

    The losses of all shares have the weights of all that a fold may learn from.
    """
    learn, held_out = drives_of(task.plan, fit, task.novice)
    seed = task.plan.seed + fit.repeat
    expert = task.expert if METHODS[fit.method].needs_expert else None
    start, before = _start(task, fit.method, learn, seed)
    started = time.perf_counter()
    model = fit_drives(
        learn, expert, fit.method, task.settings, seed, start=start, notify=False
    )
    seconds = before + time.perf_counter() - started
    if fit.share < 1 and model.scale is not None:
        whole = drives_of(task.plan, fit._replace(share=1.0), task.novice).learn
        scale = loss_scale(whole, expert, task.settings, seed)
        model = dataclasses.replace(model, scale=scale)
    with one_thread():
        losses, errors = model.losses(held_out), model.evaluate(held_out)
        worst = held_out[int(losses.losses.argmax())]
        path = model.rollout(worst.states[0], worst.actions, ground=worst.ground)
    evaluation = losses, errors, worst.name, path
    return FitResult(fit, minutes_of(learn), seconds, *evaluation)


#: Pretrained weights of this process, and the seconds they took, by what they depend
#: on.
_STARTS: dict[tuple[Any, ...], tuple[Pretrained | None, float]] = {}


def _start(
    task: Task, method: str, learn: Sequence[Drive], seed: int
) -> tuple[Pretrained | None, float]:
    """Pretrained weights of a method, which all folds of a repeat share.

    With them come the seconds that they took, now or before.
    """
    config = METHODS[method]
    if not config.pretrained:
        return None, 0.0
    assert task.expert is not None  # the plan has refused the method without one
    steps = common_length(learn, task.expert)  # of the expert's windows
    key = _digest(task), task.settings, config.all_changes, steps, seed
    if key not in _STARTS:
        _STARTS.clear()  # the fits of one repeat follow each other
        started = time.perf_counter()
        weights = pretrained(learn, task.expert, method, task.settings, seed)
        _STARTS[key] = weights, time.perf_counter() - started
    return _STARTS[key]


def key_of(task: Task, fit: Fit) -> str:
    """Name of the file of a fit's result: all that the result depends on."""
    about = {
        "fit": fit._asdict(),
        "folds": task.plan.folds,
        "seed": task.plan.seed,
        "settings": to_mapping(task.settings),
        "drives": _digest(task),
        "source": source_digest(
            *(Path(str(package.__file__)).parent for package in (sidm, ownrobot))
        ),
        "libraries": library_versions(),
    }
    text = json.dumps(about, sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()[:20]


def _digest(task: Task) -> str:
    return _digest_of(tuple(task.novice), tuple(task.expert or ()))


@functools.lru_cache(maxsize=4)
def _digest_of(*robots: tuple[Drive, ...]) -> str:
    """Digest of all numbers of the drives, their ground, sessions and bodies."""
    grounds = {id(d.ground): d.ground for drives in robots for d in drives}
    keys = {number: ground_key(ground) for number, ground in grounds.items()}

    def content(drive: Drive) -> tuple:
        numbers = checksum(drive.states), checksum(drive.actions)
        return drive.session, drive.body, keys[id(drive.ground)], *numbers

    text = repr([[content(drive) for drive in drives] for drives in robots])
    return hashlib.sha256(text.encode()).hexdigest()
