"""Results of a comparison's fits in files, so that it can be interrupted."""

from __future__ import annotations

import functools
import hashlib
import json
from pathlib import Path

import numpy as np
import pandas as pd

import ownrobot
import sidm
from ownrobot.comparison.plan import Fit, Task
from ownrobot.comparison.result import FitResult
from ownrobot.fitting.windows import ground_key
from ownrobot.versions import library_versions, source_digest
from sidm.config import to_mapping
from sidm.drives import Drive
from sidm.storage import Damaged, checksum, read_record, write_record


def file_of(task: Task, fit: Fit) -> Path | None:
    """The file of a fit's result, named by all that it depends on; None: not kept."""
    if task.folder is None:
        return None
    about = {
        "fit": fit._asdict(),
        "folds": task.plan.folds,
        "seed": task.plan.seed,
        "settings": to_mapping(task.settings),
        "drives": digest_of(tuple(task.novice), tuple(task.expert or ())),
        "source": source_digest(
            *(Path(str(package.__file__)).parent for package in (sidm, ownrobot))
        ),
        "libraries": library_versions(),
    }
    text = json.dumps(about, sort_keys=True, default=str)
    key = hashlib.sha256(text.encode()).hexdigest()[:20]
    return task.folder / "fits" / f"{key}.json"


@functools.lru_cache(maxsize=4)
def digest_of(*robots: tuple[Drive, ...]) -> str:
    """Digest of all numbers of the drives, their ground, sessions and bodies."""
    grounds = {id(d.ground): d.ground for drives in robots for d in drives}
    keys = {number: ground_key(ground) for number, ground in grounds.items()}

    def content(drive: Drive) -> tuple:
        numbers = checksum(drive.states), checksum(drive.actions)
        return drive.session, drive.body, keys[id(drive.ground)], *numbers

    text = repr([[content(drive) for drive in drives] for drives in robots])
    return hashlib.sha256(text.encode()).hexdigest()


def write_outcome(path: Path, outcome: FitResult | str) -> None:
    """Write the evaluation of a fit, or its fault, whole or not at all."""
    if isinstance(outcome, str):
        write_record(path, {"fault": outcome})
        return
    values = outcome._asdict() | {"fit": outcome.fit._asdict()}
    values |= {name: values[name].to_dict("list") for name in ("losses", "errors")}
    write_record(path, values | {"path": outcome.path.tolist()})


def read_outcome(path: Path, fit: Fit) -> FitResult | str | None:
    """The evaluation of a fit, or its fault; None where the file is missing or damaged.

    A damaged file is of no use, and its fit is done again.
    """
    try:
        values = read_record(path)
    except (FileNotFoundError, Damaged):
        return None
    if "fault" in values:
        return str(values["fault"])
    tables = {name: pd.DataFrame(values[name]) for name in ("losses", "errors")}
    read = {"fit": fit, "path": np.array(values["path"])}
    return FitResult(**(values | tables | read))
