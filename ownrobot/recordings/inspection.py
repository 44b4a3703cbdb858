"""What recordings hold, what is wrong in them, and what reading leaves out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ownrobot.body_file import as_body
from ownrobot.recordings import frames
from ownrobot.recordings.reading import as_paths, drives_of_paths
from ownrobot.recordings.table import Findings, RecordingError
from sidm.body import SI, Body
from sidm.drives import Drive, minutes_of


def inspect_drives(
    path: str | Path | Sequence[str | Path],
    body: Body | str | Path | Mapping[str, Any],
    topics: Sequence[str] = (),
    skip_bad: bool = False,
) -> dict[str, Any]:
    """What is in the files that `read_drives` would read, and all that is wrong there.

    The arguments are those of `read_drives`.

    Returns:
        Plain data: `drives`, `sessions` and `minutes` that have no fault; `steps`, of
        the shortest, the median and the longest drive; `row_rate` and `body_rate`, Hz,
        of recorded rows in the median drive (None if unknown) and of control steps;
        `columns`, of each its name, its SI unit, min, median, max and std; and lines:
        `faults` of drives and files, `common_faults` of all drives together, `notes`.

    Examples:
        >>> from ownrobot.recordings import inspect_drives
        >>> body = "recordings/hunter.yaml"
        >>> found = inspect_drives("recordings/hunter.csv.gz", body)
        >>> found["drives"], found["faults"]
        (80, [])
    """
    body, findings = as_body(body), Findings(skip=True, doubtful=not skip_bad)
    paths, drives, together = as_paths(path), list[Drive](), list[str]()
    try:
        drives = drives_of_paths(paths, body, topics, findings)
    except RecordingError as error:
        together.append(str(error))
    if drives:
        together += frames.faults_together(", ".join(map(str, paths)), drives, body)
    lengths = sorted(len(drive) for drive in drives)
    return {
        "drives": len(drives),
        "sessions": len({drive.session for drive in drives}),
        "minutes": minutes_of(drives),
        "steps": [lengths[0], round(float(np.median(lengths))), lengths[-1]]
        if drives
        else None,
        "row_rate": float(np.median(findings.rates)) if findings.rates else None,
        "body_rate": body.rate,
        "columns": _columns(drives, body) if drives else [],
        "faults": findings.faults,
        "common_faults": together,
        "notes": findings.notes,
    }


def _columns(drives: Sequence[Drive], body: Body) -> list[dict[str, Any]]:
    """Numbers that sum up each column of states and actions."""
    states = np.concatenate([drive.states for drive in drives])
    actions = np.concatenate([drive.actions for drive in drives])
    columns = (*body.state, *body.actions)
    return [
        {
            "name": name,
            "unit": SI[unit],
            "min": float(values.min()),
            "median": float(np.median(values)),
            "max": float(values.max()),
            "std": float(values.std()),
        }
        for (name, unit), values in zip(columns, (*states.T, *actions.T), strict=True)
    ]
