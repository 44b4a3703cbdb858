"""One trial of the benchmark: a method on a task with a seed, in a process of its own.

The method gets the drives of novice and expert. Its model is judged by `evaluation`.
"""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal

import torch

from companion.engine.provenance import Provenance, peak_memory, record_provenance
from companion.tasks.catalogue import Task, load_task
from companion.tasks.evaluation import Refused, evaluate
from companion.tasks.methods import load_method
from ownrobot.methods.registry import METHODS
from sidm.config import ConfigError, config, first_line, from_mapping, to_mapping

LIMIT = 3600.0  # s, for one trial

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
        code: digest of the method's file; '' for those of `ownrobot`
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


def run_trial(
    about: Entry,
    method: str,
    data: str | Path,
    limit: float = LIMIT,
    folder: str | Path | None = None,
) -> EntryResult:
    """Run a trial in a process of its own, which is killed after `limit` seconds."""
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
    made = record_provenance(
        time.perf_counter() - started, 1, kind=kind_of(about.method)
    )
    return from_mapping(EntryResult, {"about": about, "provenance": made} | values)


def kind_of(method: str) -> str:
    """The kind of work of a method's trial, a key of `numerics.RESULT_VERSIONS`."""
    known = METHODS.get(method)
    fit = "" if known is None else known.fit
    return fit if fit in ("trees", "gaussian_process") else "benchmark"


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
        values = evaluate(model, motion)
    except Refused as refused:
        return {"status": refused.args[0], "message": refused.args[1]}
    except Exception as error:  # a method may raise anything
        text = f"{type(error).__name__}: {first_line(error)}"
        return {"status": "raised", "message": text[:300]}
    return values | {"status": "ok", "seconds": seconds, "memory": peak_memory()}


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
