"""Read and write drives as CSV files, which may be compressed.

A file begins with header lines `# name: value`, whose names are those of HEADER. The
next line has the names of the columns, with units in brackets:

    # rate: 20 Hz
    drive,x [m],y [m],yaw [deg],yaw_rate [rad/s],left [rad/s],right [rad/s]

The columns are those of the body's state and actions, in any order and in any unit of
their kind. Three more columns have a meaning: `time` replaces the rate; `drive` changes
where a new drive begins; drives of the same `session` are never divided between
training and evaluation. All other columns are ignored. Semicolons or tabs may stand in
place of the commas; numbers may then have decimal commas. A line `# rate` is not used
where there is a column `time`; a time may be in s, ms, us or ns, or be two columns of
seconds and nanoseconds.

For a body with a height map, the header names a file of heights beside the CSV file
(`heights`) and its grid's `spacing`.
"""

from __future__ import annotations

import csv
import gzip
import io
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from ownrobot.recordings.csv_text import HEADER, TextTable, as_float, split_header
from ownrobot.recordings.exports import read_text
from ownrobot.recordings.table import RecordingError, Table, unit_factors
from sidm.body import SI, Body
from sidm.config import first_line
from sidm.drives import Drive, Ground
from sidm.storage import write_atomically


def read_csv(path: Path, body: Body, lenient: bool = False) -> Table:
    """Read a body's columns; if `lenient`, what is no number can be NaN."""
    text = read_text(path)
    header, names = text.header, text.names
    timed = "time" in names
    if not timed and "rate" not in header:
        raise RecordingError(
            "it has neither a line '# rate: 10 Hz' nor a column 'time [s]'"
        )
    factors = unit_factors(names, text.units, body, timed)
    labels: dict[str, np.ndarray] = {
        name: np.array(text.column(name))
        for name in ("drive", "session")
        if name in names
    }
    lenient = lenient and bool(labels)
    columns = {
        name: (text.elapsed() if name == "time" else text.numbers(name, lenient))
        * factor
        for name, factor in factors.items()
    }
    rate = None if timed else rate_of(text)
    ground = _ground(path.parent, header) if body.map_size else None
    return Table(str(path), columns, labels, rate, ground, text.notes)


def rate_of(text: TextTable) -> float:
    """The rate in a file's header, Hz."""
    return _number(text.header, "rate", "Hz")


def heights_file(path: Path) -> Path | None:
    """The file of heights that a file of drives names in its header, if any."""
    try:
        return path.parent / split_header(path)[0]["heights"]
    except (RecordingError, KeyError):
        return None


def _number(header: Mapping[str, str], name: str, unit: str) -> float:
    number = as_float(header[name].removesuffix(unit))
    if not 0 < number < float("inf"):
        raise RecordingError(
            f"'{name}: {header[name]}' is not a positive number in {unit}"
        )
    return number


def _ground(folder: Path, header: Mapping[str, str]) -> Ground:
    """The ground that a header describes, with heights (H, W), m, of another file."""
    for name in ("heights", "spacing"):
        if name not in header:
            raise RecordingError(
                f"the header has no line '# {name}: ...' ({HEADER[name]})"
            )
    try:
        x, y = map(float, header.get("centre", "0 0").removesuffix("m").split())
    except ValueError:
        raise RecordingError(
            f"'centre: {header['centre']}' is not an x and a y in m"
        ) from None
    file = folder / header["heights"]
    try:
        if file.suffix == ".npy":
            heights = np.load(file, allow_pickle=False)
        else:
            heights = np.loadtxt(file, delimiter=",", ndmin=2, encoding="utf-8-sig")
    except FileNotFoundError:
        raise RecordingError("there is no such file of heights", file) from None
    except (OSError, ValueError, EOFError) as error:
        fault = f"the heights cannot be read ({first_line(error)})"
        raise RecordingError(fault, file) from None
    return Ground(heights, _number(header, "spacing", "m"), (x, y))


def write_csv(path: Path, drives: Sequence[Drive], origin: str) -> None:
    """Write drives in SI units, compressed where the file's name ends in .gz."""
    body = drives[0].body
    file = io.StringIO()
    file.write(f"# origin: {origin}\n# rate: {body.rate:g} Hz\n")
    lines = csv.writer(file, lineterminator="\n")
    titles = [f"{name} [{SI[unit]}]" for name, unit in (*body.state, *body.actions)]
    lines.writerow(["session", "drive", *titles])
    for number, drive in enumerate(drives):
        actions = np.vstack([drive.actions, drive.actions[-1:]])
        for row in np.hstack([drive.states, actions]):
            lines.writerow([drive.session, number, *(f"{value:.9g}" for value in row)])
    text = file.getvalue().encode()
    packed = gzip.compress(text, mtime=0) if path.suffix == ".gz" else text
    write_atomically(path, lambda file: file.write(packed))
