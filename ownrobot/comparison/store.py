"""Results of a comparison's fits in files, so that it can be interrupted."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from ownrobot.comparison.plan import Fit
from ownrobot.comparison.result import FitResult
from ownrobot.fitting.score import DriveLosses
from sidm.storage import write_atomically


def write_result(path: Path, result: FitResult) -> None:
    """Write the evaluation of a fit, whole or not at all."""
    losses = {
        name: None if values is None else values.tolist()
        for name, values in result.losses._asdict().items()
    }
    _write(
        path,
        {
            "fit": result.fit._asdict(),
            "minutes": result.minutes,
            "seconds": result.seconds,
            "losses": losses,
            "errors": result.errors.to_dict("list"),
            "worst": result.worst,
            "path": result.path.tolist(),
        },
    )


def write_fault(path: Path, fault: str) -> None:
    """Write the line of a fault that a fit had."""
    _write(path, {"fault": fault})


def read_result(file: Path, fit: Fit) -> FitResult | str | None:
    """The evaluation of a fit, or its fault; None where the file is missing or damaged.

    A damaged file is of no use, and its fit is done again.
    """
    try:
        values = json.loads(file.read_text(encoding="utf-8"))
        if "fault" in values:
            return str(values["fault"])
        losses: dict[str, Any] = {
            name: None if entry is None else np.array(entry)
            for name, entry in values["losses"].items()
        }
        errors = pd.DataFrame(values["errors"])
        return FitResult(
            fit,
            minutes=values["minutes"],
            seconds=values["seconds"],
            losses=DriveLosses(**losses),
            errors=errors,
            worst=values["worst"],
            path=np.array(values["path"]),
        )
    except (OSError, ValueError, KeyError, TypeError):
        return None


def _write(path: Path, values: dict[str, Any]) -> None:
    content = json.dumps(values).encode()
    write_atomically(path, lambda file: file.write(content))
