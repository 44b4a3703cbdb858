"""Results of a comparison's fits in files, so that it can be interrupted."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from ownrobot.comparison.plan import Fit
from ownrobot.comparison.result import FitResult
from ownrobot.fitting.score import DriveLosses
from sidm.storage import Damaged, read_record, write_record


def write_result(path: Path, result: FitResult) -> None:
    """Write the evaluation of a fit, whole or not at all."""
    values = result._asdict() | {"fit": result.fit._asdict()}
    losses = {
        name: None if entry is None else entry.tolist()
        for name, entry in result.losses._asdict().items()
    }
    tables = {"errors": result.errors.to_dict("list"), "path": result.path.tolist()}
    write_record(path, values | tables | {"losses": losses})


def read_result(file: Path, fit: Fit) -> FitResult | str | None:
    """The evaluation of a fit, or its fault; None where the file is missing or damaged.

    A damaged file is of no use, and its fit is done again.
    """
    try:
        values = read_record(file)
    except (FileNotFoundError, Damaged):
        return None
    if "fault" in values:
        return str(values["fault"])
    losses = {
        name: None if entry is None else np.array(entry)
        for name, entry in values["losses"].items()
    }
    tables = {
        "errors": pd.DataFrame(values["errors"]),
        "path": np.array(values["path"]),
    }
    read = {"fit": fit, "losses": DriveLosses(**losses)}  # type: ignore[arg-type]
    return FitResult(**(values | tables | read))
