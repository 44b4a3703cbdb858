"""Compare methods on a robot's drives (`ownrobot.compare`)."""

from __future__ import annotations

import dataclasses
import time
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ownrobot.comparison.plan import (
    FOLDS,
    REPEATS,
    SHARES,
    Fit,
    Task,
    drives_of,
    plan_for,
)
from ownrobot.comparison.result import Comparison, FitResult
from ownrobot.comparison.store import digest_of, file_of, read_outcome, write_outcome
from ownrobot.fitting.arguments import robots_from
from ownrobot.fitting.learning import NOTHING, settings_with, without_effect
from ownrobot.fitting.single import data_of, fit_drives, pretrained
from ownrobot.fitting.windows import common_length
from ownrobot.methods.registry import METHODS
from sidm.config import ConfigError, Notice, first_line, replace
from sidm.drives import Drive, minutes_of
from sidm.learning.arithmetic import one_thread
from sidm.learning.stopping import TrainingError
from sidm.pool import as_completed, local_pool
from sidm.progress import progress_bar
from sidm.settings import Network, Training

if TYPE_CHECKING:
    from ownrobot.fitting.arguments import BodyLike, Drives
    from ownrobot.methods.fine_tuning import Pretrained


def compare(
    novice: Drives,
    expert: Drives | None = None,
    methods: Sequence[str] = (),
    *,
    body: BodyLike | None = None,
    expert_body: BodyLike | None = None,
    network: Network | None = None,
    training: Training | None = None,
    settings: Mapping[str, Any] = NOTHING,
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
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", Notice)
        drives, experts = robots_from(
            novice, expert, body, expert_body, topics=topics, skip_bad=skip_bad
        )
    for one in caught:  # notices are shown, and kept for the report
        warnings.warn_explicit(one.message, one.category, one.filename, one.lineno)
    notices = [str(one.message) for one in caught if issubclass(one.category, Notice)]
    if workers < 1:
        raise ConfigError(f"workers must be at least 1, not {workers}")
    methods = [methods] if isinstance(methods, str) else methods
    drives = _named(drives)
    plan = plan_for(drives, experts, methods, folds, repeats, shares, seed)
    notes = []
    if plan.repeats < repeats:
        parts = f"{plan.folds} sessions or drives"
        notes.append(f"{parts} can be held out in one way: 1 repeat, not {repeats}")
    if experts and not any(METHODS[name].needs_expert for name in plan.methods):
        notes.append("none of the methods learns from the expert's drives")
    notes.append(without_effect(plan.methods, settings, drives[0].body))
    for note in filter(None, notes):
        warnings.warn(Notice(note), stacklevel=2)
        notices.append(note)
    chosen = settings_with(network, training, settings)
    task = Task(plan, drives, experts, chosen, None if folder is None else Path(folder))
    fits, outcomes = plan.fits(), []
    with (
        progress_bar(len(fits), "comparing", "fit", progress) as bar,
        local_pool(workers) as pool,
    ):
        for future in as_completed([pool.submit(outcome_of, task, f) for f in fits]):
            outcomes.append(future.result())
            bar.update()
    results = [outcome for outcome in outcomes if isinstance(outcome, FitResult)]
    faults = sorted({outcome for outcome in outcomes if isinstance(outcome, str)})
    for fault in faults:
        warnings.warn(Notice(fault), stacklevel=2)
    comparison = Comparison(plan, results, (*notices, *faults), drives)
    if not comparison.methods:
        raise ConfigError(faults[0])
    return comparison


def _named(drives: list[Drive]) -> list[Drive]:
    """Drives with names that differ: numbers are added where names are alike."""
    if len({drive.name for drive in drives}) == len(drives):
        return drives
    return [
        replace(drive, name=f"{drive.name} {number}".strip())
        for number, drive in enumerate(drives)
    ]


def outcome_of(task: Task, fit: Fit) -> FitResult | str:
    """The result of a fit, or the line of the fault that it had; kept in the folder."""
    path = file_of(task, fit)
    outcome = None if path is None else read_outcome(path, fit)
    if isinstance(outcome, FitResult):  # files may have moved: drives have new names
        held_out = drives_of(task.plan, fit, task.novice).held_out
        names = [drive.name for drive in held_out]
        return outcome._replace(losses=outcome.losses.assign(drive=names))
    if outcome is None:
        try:
            outcome = _fitted(task, fit)
        except (ConfigError, TrainingError) as error:
            share = f"{fit.share:.0%} of the data"
            outcome = f"{fit.method} with {share}: {first_line(error)}"
        if path is not None:
            write_outcome(path, outcome)
    return outcome


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
        scale = data_of(whole, expert, task.settings, seed).scale
        model = dataclasses.replace(model, scale=scale)
    with one_thread():
        losses, errors = model.losses(held_out), model.evaluate(held_out)
        worst = held_out[int(losses.loss.argmax())]
        path = model.rollout(worst.states[0], worst.actions, ground=worst.ground)
    return FitResult(fit, minutes_of(learn), seconds, losses, errors, path)


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
    digest = digest_of(tuple(task.novice), tuple(task.expert))
    steps = common_length(learn, task.expert)  # of the expert's windows
    key = digest, task.settings, config.all_changes, steps, seed
    if key not in _STARTS:
        _STARTS.clear()  # the fits of one repeat follow each other
        started = time.perf_counter()
        weights = pretrained(data_of(learn, task.expert, task.settings, seed), method)
        _STARTS[key] = weights, time.perf_counter() - started
    return _STARTS[key]
