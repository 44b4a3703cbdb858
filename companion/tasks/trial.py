"""One trial of the benchmark: a method on a task with a seed, in a process of its own.

The method gets the drives of novice and expert. Its model predicts the drives that
judge, one after the other, without memory of the drives before.
"""

from __future__ import annotations

import json
import resource
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np
import torch
from torch import Tensor

from companion.engine.provenance import Provenance, here
from companion.tasks.catalogue import Task, TaskData, load_task
from companion.tasks.methods import FittedModel, load_method
from sidm.body import Body
from sidm.config import ConfigError, config, first_line, from_mapping, to_mapping
from sidm.drives import Drive
from sidm.learning.evaluation import rollout_errors
from sidm.learning.observation import integrate, transition
from sidm.learning.units import Standardisation, loss_weights
from sidm.rivals.methods import METHODS

LIMIT = 3600.0  # s, for one trial
AHEAD = 1.0  # s, of the open-loop errors
START = 20  # step at which open-loop predictions start, or fewer in shorter drives
OPEN_LOOP_DRIVES = 64  # drives that are predicted open loop
CHECKED = 3  # drives at which the use of later states is looked for
PEEKED = 1e-3  # of a component's standard deviation; rounding changes far less

Status = Literal[
    "ok",
    "not for these robots",
    "raised",
    "not finite",
    "wrong shape",
    "not reproducible",
    "peeked",
    "limit",
]
NO_FAILURE = "ok", "not for these robots"


@config
class Entry:
    """A method on a task with a seed.

    Attributes:
        method: name of a library's method, or a file and a class, joined by a colon
        code: digest of the method's file; '' for the library's
        task: the task
        seed: of the drives that are drawn, and of the method
    """

    method: str
    code: str = ""
    task: Task
    seed: int


@config
class EntryResult:
    """What a trial gave.

    Attributes:
        about: which trial
        status: 'ok', or why there are no errors; a failure unless in NO_FAILURE
        message: one line about it
        loss: equation (1), the mean of a step of the drives that judge; each component
            over its variance there unless the body says otherwise
        components: (Y,) terms of the loss
        position: root mean square of the position error after AHEAD seconds, m
        heading: root mean square of the heading error after AHEAD seconds, rad
        seconds: of the fit
        memory: most memory of the process, MiB
        provenance: how it was made
    """

    about: Entry
    status: Status
    message: str = ""
    loss: float | None = None
    components: tuple[float, ...] = ()
    position: float | None = None
    heading: float | None = None
    seconds: float | None = None
    memory: float | None = None
    provenance: Provenance


class Refused(Exception):
    """A model that does not count; its arguments are status and message."""


def run_trial(
    about: Entry,
    method: str,
    data: str | Path,
    limit: float = LIMIT,
    folder: str | Path | None = None,
) -> EntryResult:
    """Run a trial in a process of its own, which is killed after `limit` seconds.

    Args:
        about: the trial.
        method: the method's name, with its path.
        data: folder of simulated motion.
        limit: most seconds.
        folder: where the trial runs: paths are relative to it, and the recordings are
            in it; None: the working directory.
    """
    started = time.perf_counter()
    with tempfile.TemporaryDirectory() as scratch:
        out = Path(scratch) / "result.json"
        task = json.dumps(to_mapping(about.task))
        words = [method, task, str(about.seed), str(data), str(out)]
        command = [sys.executable, "-m", "companion.tasks.trial", *words]
        values: dict[str, Any] = {"status": "limit", "message": f"after {limit:g} s"}
        try:
            ended = subprocess.run(
                command, capture_output=True, text=True, timeout=limit, cwd=folder
            )
            values = {"status": "raised", "message": _how_it_ended(ended)}
            if out.is_file():
                values = json.loads(out.read_text())
        except subprocess.TimeoutExpired:
            pass
    known = METHODS.get(about.method)
    kind = "trees" if known is not None and known.fit == "trees" else "benchmark"
    made = here(time.perf_counter() - started, 1, kind=kind)
    return from_mapping(EntryResult, {"about": about, "provenance": made} | values)


def _how_it_ended(ended: subprocess.CompletedProcess[str]) -> str:
    """Why a process has left no result: a signal, an exception or an exit status."""
    if ended.returncode < 0:
        return f"the process was ended by {signal.Signals(-ended.returncode).name}"
    lines = ended.stderr.strip().splitlines()
    if "Traceback (most recent call last):" in lines:
        return lines[-1][:300]
    return f"the process ended with exit status {ended.returncode}"


def measure(method: str, task: Task, seed: int, data: str | Path) -> dict[str, Any]:
    """The values of an EntryResult, without `about` and `provenance`."""
    motion = load_task(task, seed, data)
    entered = load_method(method)
    started = time.perf_counter()
    try:
        try:
            model = entered.fit(motion.novice, motion.expert, seed)
        except NotImplementedError as error:
            raise Refused("not for these robots", first_line(error)[:300]) from None
        seconds = time.perf_counter() - started
        values = _evaluate(model, motion)
    except Refused as refused:
        return {"status": refused.args[0], "message": refused.args[1]}
    except Exception as error:  # a method may raise anything
        text = f"{type(error).__name__}: {first_line(error)}"
        return {"status": "raised", "message": text[:300]}
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    return values | {"status": "ok", "seconds": seconds, "memory": memory}


def _evaluate(model: FittedModel, motion: TaskData) -> dict[str, Any]:
    """Loss and open-loop errors of a model on the drives that judge."""
    drives, body = motion.validation, motion.validation[0].body
    targets = [_targets(drive) for drive in drives]
    std = torch.cat(targets).std(0, correction=0)
    units = Standardisation.none(body)._replace(target_std=std)
    weights = loss_weights(body, units)
    predictions = [_predictions(model, drive) for drive in drives]
    errors = torch.cat([torch.from_numpy(p) for p in predictions]) - torch.cat(targets)
    terms = errors.square() if weights is None else errors.square() * weights
    _refuse_peeking(model, drives, predictions, std.numpy())
    components = terms.mean(0).tolist()
    values = {"loss": sum(components), "components": components}
    return values | _open_loop(model, drives, body)


def _targets(drive: Drive) -> Tensor:
    """Transitions (K, Y), float64, of a drive's steps."""
    states = torch.from_numpy(drive.states).double()
    return transition(states[:-1], states[1:], drive.body)


def _predictions(model: FittedModel, drive: Drive) -> np.ndarray:
    """Predicted transitions (K, Y), float64, checked."""
    predicted = np.asarray(model.predict(drive), float)
    expected = (len(drive), len(drive.body.targets))
    if predicted.shape != expected:
        raise Refused(
            "wrong shape", f"predictions of shape {predicted.shape}, not {expected}"
        )
    if not np.isfinite(predicted).all():
        raise Refused("not finite", f"{drive.name}: a prediction is not finite")
    return predicted


def _refuse_peeking(
    model: FittedModel,
    drives: Sequence[Drive],
    predictions: Sequence[np.ndarray],
    std: np.ndarray,
) -> None:
    """Refuse a model whose prediction of a step depends on what comes after.

    A model that draws without a seed is refused first: nothing could be told of it.
    """
    for drive, full in zip(drives[:CHECKED], predictions, strict=False):
        again = _predictions(model, drive)
        if (np.abs(again - full) > PEEKED * std).any():
            raise Refused(
                "not reproducible", f"{drive.name}: its predictions differ if repeated"
            )
        for step in (len(drive) // 3, len(drive) - 1):
            states = drive.states[: step + 2].copy()
            states[-1] = states[-2]  # the state after is not known
            actions = drive.actions[: step + 1]
            hidden = Drive(states, actions, drive.body, drive.ground, name=drive.name)
            difference = np.abs(_predictions(model, hidden)[step] - full[step])
            if (difference > PEEKED * std).any():
                raise Refused(
                    "peeked",
                    f"{drive.name}: the prediction of step {step} changes with the "
                    "state after it",
                )


def _open_loop(
    model: FittedModel, drives: Sequence[Drive], body: Body
) -> dict[str, float]:
    """Errors of position and heading after AHEAD seconds; {} without a pose."""
    steps = round(AHEAD * body.rate)
    chosen = [d for d in drives if len(d) >= steps][:OPEN_LOOP_DRIVES]
    if body.pose == "none" or not chosen:
        return {}
    paths, actual = [], []
    for drive in chosen:
        first = min(START, len(drive) - steps)
        actions = drive.actions[first : first + steps]
        state = drive.states[first]
        if hasattr(model, "rollout"):
            path = np.asarray(model.rollout(state, actions, drive.ground), float)
        else:
            path = derived_rollout(model, drive, first, steps)
        paths.append(torch.from_numpy(path))
        actual.append(torch.from_numpy(drive.states[first : first + steps + 1]))
    errors = rollout_errors(torch.stack(paths), torch.stack(actual).double(), body)
    position, heading = (float(e[:, -1].square().mean().sqrt()) for e in errors)
    if not np.isfinite([position, heading]).all():
        raise Refused("not finite", "an open-loop prediction is not finite")
    return {"position": position, "heading": heading}


def derived_rollout(
    model: FittedModel, drive: Drive, first: int, steps: int
) -> np.ndarray:
    """Open-loop states (K + 1, S) of a model that has no `rollout` of its own.

    Each step is predicted by itself, so that the model has no memory.
    """
    state = drive.states[first].astype(float)
    path = [state]
    for step in range(first, first + steps):
        action = drive.actions[step : step + 1]
        one = Drive(np.stack([state, state]), action, drive.body, drive.ground)
        transition = torch.from_numpy(_predictions(model, one))
        state = integrate(torch.from_numpy(state)[None], transition, drive.body)[0]
        state = state.numpy()
        path.append(state)
    return np.stack(path)


def main(words: Sequence[str]) -> None:
    """Run the trial that the words describe, and write its values to a file."""
    method, task, seed, data, out = words
    torch.set_num_threads(1)
    try:
        values = measure(method, from_mapping(Task, json.loads(task)), int(seed), data)
    except ConfigError as error:
        values = {"status": "raised", "message": first_line(error)}
    Path(out).write_text(json.dumps(values))


if __name__ == "__main__":
    main(sys.argv[1:])
