"""What recordings hold, what is wrong in them, and what reading leaves out."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ownrobot.body_file import as_body
from ownrobot.recordings import checks, frames
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

    Args:
        path: of the file, the bag or the folder, or a sequence of such paths.
        body: the robot's body, its YAML file, or the mapping in such a file.
        topics: names of the topics to read from bags.
        skip_bad: whether drives that are read with a note alone count as faulty, as in
            `read_drives`.

    Returns:
        Plain data, by these names:

        - drives: how many have no fault
        - sessions: how many these drives have
        - minutes: of motion in these drives
        - steps: control steps of the shortest, the median and the longest drive
        - row_rate: recorded rows a second in the median drive, Hz; None if unknown
        - body_rate: control steps a second, Hz
        - columns: for each column of states and actions its name, its SI unit, min,
          median, max and std
        - faults: one line for each drive or file that has a fault
        - common_faults: one line for each fault of all drives together
        - notes: one line each: what reading does with pauses and unknown units, and
          drives that are off their yaw

    Raises:
        ConfigError: the body has a fault.

    Examples:
        >>> from ownrobot.recordings import inspect_drives
        >>> body = "recordings/hunter.yaml"
        >>> found = inspect_drives("recordings/hunter.csv.gz", body)
        >>> found["drives"], found["faults"]
        (80, [])
    """
    body, findings = as_body(body), Findings(skip=True, doubtful=not skip_bad)
    paths, together = as_paths(path), list[str]()
    drives: list[Drive] = []
    with _kept_in(together):
        drives = drives_of_paths(paths, body, topics, findings)
    where = ", ".join(map(str, paths))
    if drives:
        constant = checks.constant_columns(drives, body)
        together += [checks.constant_text(where, column) for column in constant]
        with _kept_in(together):
            frames.refuse_together(where, drives, body)
    lengths = [len(drive) for drive in drives]
    return {
        "drives": len(drives),
        "sessions": len({drive.session for drive in drives}),
        "minutes": minutes_of(drives),
        "steps": _spread(lengths) if drives else None,
        "row_rate": float(np.median(findings.rates)) if findings.rates else None,
        "body_rate": body.rate,
        "columns": _columns(drives, body) if drives else [],
        "faults": findings.faults,
        "common_faults": together,
        "notes": findings.notes,
    }


@contextlib.contextmanager
def _kept_in(faults: list[str]) -> Iterator[None]:
    """Put the message of a RecordingError into a list instead of raising it."""
    try:
        yield
    except RecordingError as error:
        faults.append(str(error))


def _spread(values: Sequence[int]) -> list[int]:
    """The least, the median and the largest of some numbers."""
    return [min(values), round(float(np.median(values))), max(values)]


def _columns(drives: Sequence[Drive], body: Body) -> list[dict[str, Any]]:
    """Numbers that sum up each column of states and actions."""
    states = np.concatenate([drive.states for drive in drives])
    actions = np.concatenate([drive.actions for drive in drives])
    summaries = []
    for (name, unit), values in zip(
        (*body.state, *body.actions), (*states.T, *actions.T), strict=True
    ):
        numbers = {
            "min": values.min(),
            "median": np.median(values),
            "max": values.max(),
            "std": values.std(),
        }
        plain = {kind: float(number) for kind, number in numbers.items()}
        summaries.append({"name": name, "unit": SI[unit]} | plain)
    return summaries
