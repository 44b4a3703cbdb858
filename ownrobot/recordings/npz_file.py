"""Read and write many drives in one .npz file.

========  =========  =================================================================
member    shape      content
========  =========  =================================================================
rows      (R, C)     numbers: the rows of all drives, one drive after the other
lengths   (N,)       number of rows of each drive
header    ()         text: JSON with the fields of `Header`
sessions  (N,)       text: drives of one session belong together; may be missing
ground    (N,)       for a body with a height map: the number of each drive's ground
heights   (M, H, W)  for a body with a height map: grounds, index [y, x], each once
========  =========  =================================================================
"""

from __future__ import annotations

import json
import zipfile
import zlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ownrobot.recordings.table import RecordingError, Table, unit_factors
from sidm.body import SI, UNITS, Body
from sidm.config import completed, config, first_line, from_mapping
from sidm.drives import Drive, Ground
from sidm.storage import write_atomically

# What a file must have; the latter where it has grounds.
MEMBERS, MEMBERS_OF_GROUNDS = ("rows", "lengths", "header"), ("ground", "heights")
HEIGHT_UNITS = ("m", "cm", "mm")


@config
class Header:
    """The header of a file; its last three fields are of grounds."""

    columns: tuple[str, ...]  # names of the columns
    units: tuple[str, ...]  # units of the columns
    rate: float  # Hz, rows per second
    origin: str  # where the drives come from, for people
    spacing: float = 0.0  # m, of the grounds' grids
    height_unit: str = ""  # one of HEIGHT_UNITS
    #: m, x and y of each ground's middle; all 0 unless given
    centres: tuple[tuple[float, float], ...] = ()


def read_npz(path: Path, body: Body) -> list[Table]:
    """Read the drives of a file, a table each; RecordingError names the first fault."""
    try:
        file = np.load(path, allow_pickle=False)
        if isinstance(file, np.ndarray):
            raise ValueError("it holds one array, as .npy files do")
        with file:
            members = {name: file[name] for name in file.files}
    except (OSError, ValueError, EOFError, zipfile.BadZipFile, zlib.error) as error:
        # NumPy's own message about bytes that are no archive is about pickles
        fault = "it is no archive" if "pickle" in str(error) else first_line(error)
        raise RecordingError(
            f"cannot be read as .npz ({fault}); copy it again, or write it "
            "with numpy.savez"
        ) from None
    required = [*MEMBERS, *(MEMBERS_OF_GROUNDS if body.map_size else ())]
    for name in required:
        if name not in members:
            raise RecordingError(
                f"member '{name}' is missing; "
                f"a file of drives has {', '.join(required)}"
            )
    header = _header(members["header"])
    rows, lengths = members["rows"], _whole_numbers("lengths", members["lengths"])
    names, units, count = header.columns, header.units, len(lengths)
    if rows.shape != (lengths.sum(), len(names)) or len(units) != len(names):
        raise RecordingError(
            f"rows {rows.shape}, {len(names)} columns, {len(units)} units and "
            f"{count} lengths with sum {lengths.sum()} do not belong together"
        )
    if rows.dtype.kind not in "fiu":
        raise RecordingError(f"rows of {rows.dtype}, not of numbers")
    factors = unit_factors(names, units, body, "time" in names)
    grounds = _grounds(members, header, count) if body.map_size else None
    sessions = members.get("sessions", np.full(count, ""))
    if sessions.shape != lengths.shape or sessions.dtype.kind != "U":
        raise RecordingError(
            f"sessions {sessions.shape} of {sessions.dtype}, not a text for each drive"
        )
    rate = None if "time" in factors else header.rate
    if rate is not None and not 0 < rate < float("inf"):
        raise RecordingError(f"a rate of {rate:g} Hz; it must be positive")
    tables = []
    for number, part in enumerate(np.split(rows, np.cumsum(lengths)[:-1])):
        columns = {
            name: part[:, names.index(name)].astype(float) * factor
            for name, factor in factors.items()
        }
        labels = {"session": np.full(len(part), sessions[number])}
        ground = grounds[number] if grounds else None
        tables.append(Table(f"{path} drive {number}", columns, labels, rate, ground))
    return tables


def _header(member: np.ndarray) -> Header:
    """The header of a file, checked."""
    try:
        values = json.loads(str(member), parse_int=float)
        return from_mapping(Header, completed(Header, values))
    except (ValueError, AttributeError) as error:
        raise RecordingError(
            f"the header cannot be read ({first_line(error)}); write JSON with "
            "columns, units, rate and origin"
        ) from None


def _grounds(
    members: Mapping[str, np.ndarray], header: Header, drives: int
) -> list[Ground]:
    """The ground of each of a file's drives; `drives` is how many there are."""
    numbers = _whole_numbers("ground", members["ground"])
    heights = members["heights"]
    if heights.ndim != 3 or heights.dtype.kind not in "fiu":
        raise RecordingError(
            f"heights {heights.shape} of {heights.dtype}, not of numbers"
        )
    count, largest = len(heights), numbers.max()
    centres = header.centres or ((0.0, 0.0),) * count
    if len(centres) != count or len(numbers) != drives or largest >= count:
        raise RecordingError(
            f"{count} heights, but 'ground' of {len(numbers)} drives "
            f"goes up to {largest} and there are {len(centres)} centres"
        )
    if header.height_unit not in HEIGHT_UNITS:
        raise RecordingError(
            f"the header has height_unit {header.height_unit!r}, not one of "
            f"{', '.join(HEIGHT_UNITS)}"
        )
    scale = UNITS["length"][header.height_unit]
    return [Ground(heights[n] * scale, header.spacing, centres[n]) for n in numbers]


def _whole_numbers(name: str, member: np.ndarray) -> np.ndarray:
    """A member of whole numbers, 0 or more, as int; RecordingError for others."""
    whole = member.ndim == 1 and member.dtype.kind in "iu"
    if not whole or not len(member) or member.min() < 0:
        raise RecordingError(
            f"'{name}' of shape {member.shape} and {member.dtype}, "
            "not a row of whole numbers"
        )
    return member.astype(int)


def write_npz(path: Path, drives: Sequence[Drive], origin: str) -> None:
    """Write drives in SI units: each ground once, heights in whole mm.

    Grounds of several shapes or spacings raise ValueError.
    """
    body = drives[0].body
    columns = dict((*body.state, *body.actions))
    header: dict[str, Any] = {
        "columns": list(columns),
        "units": [SI[unit] for unit in columns.values()],
        "rate": body.rate,
        "origin": origin,
    }
    rows = [
        np.hstack([d.states, np.vstack([d.actions, d.actions[-1:]])]) for d in drives
    ]
    members: dict[str, Any] = {
        "rows": np.vstack(rows),
        "lengths": np.array([len(part) for part in rows]),
        "sessions": np.array([drive.session for drive in drives]),
    }
    if body.map_size:
        grounds = [drive.ground for drive in drives if drive.ground is not None]
        heights = [np.round(1e3 * g.heights).astype(np.int32) for g in grounds]
        shapes, spacings = {h.shape for h in heights}, {g.spacing for g in grounds}
        if len(shapes) != 1 or len(spacings) != 1:
            raise ValueError("drives to pack have grounds of one shape and spacing")
        if max(np.abs(h).max() for h in heights) <= np.iinfo(np.int16).max:
            heights = [h.astype(np.int16) for h in heights]
        different = {h.tobytes(): h for h in heights}
        order = [*different]
        members["ground"] = np.array([order.index(h.tobytes()) for h in heights])
        members["heights"] = np.stack([*different.values()])
        header |= {"spacing": grounds[0].spacing, "height_unit": "mm"}
    members["header"] = np.array(json.dumps(header))
    write_atomically(
        path, lambda file: np.savez_compressed(file, allow_pickle=False, **members)
    )
