"""Many drives in one .npz file: the rows of all one after the other, each ground once, and a header in JSON.

=========  ===============
============================================================================ member     shape            what it is
=========  ===============
============================================================================ rows       (R, C)           numbers
lengths    (N,)             rows of each drive
header     ()               text: JSON with the names of HEADER
sessions   (N,)             text: drives of one belong together; may be missing
ground     (N,)             of a body with a height map: which of the grounds each drove on
heights    (M, H, W)        of such a body: grounds, index [y, x]
=========  ===============
============================================================================
"""

from __future__ import annotations

import json
import sys
import zipfile
import zlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from sidm.body import SI, UNITS, Body
from sidm.config import first_line, unknown_name
from sidm.drives import Drive, Ground
from sidm.recordings.csv_file import scales
from sidm.recordings.table import RecordingError, Table
from sidm.storage import write_atomically

#: Names of the header -> types.
HEADER: dict[str, tuple[type, ...]] = {
    "columns": (list,),  # names
    "units": (list,),  # one a column
    "rate": (int, float),  # rows a second, Hz
    "origin": (str,),  # where the drives are from, for people
    "spacing": (int, float),  # of the grounds' grids, m
    "height_unit": (str,),  # m, cm or mm
    "centres": (list,),  # x and y of each ground's middle, m; all 0 unless given
}
WANTED, OF_GROUNDS = ("columns", "units", "rate", "origin"), ("spacing", "height_unit")


def read_npz(path: Path, body: Body) -> list[Table]:
    """The drives of a file, a table each; RecordingError names the first fault."""
    try:
        file = np.load(path, allow_pickle=False)
        if isinstance(file, np.ndarray):
            raise ValueError("it holds one array, as .npy files do")
        with file:
            members = {name: file[name] for name in file.files}
    except (OSError, ValueError, EOFError, zipfile.BadZipFile, zlib.error) as error:
        raise RecordingError(
            f"{path}: cannot be read as .npz ({first_line(error)})"
        ) from None
    wanted = (
        "rows",
        "lengths",
        "header",
        *(("ground", "heights") if body.map_size else ()),
    )
    for name in wanted:
        if name not in members:
            raise RecordingError(
                f"{path}: member '{name}' is missing; a file of drives has {', '.join(wanted)}"
            )
    header = _header(path, members["header"], bool(body.map_size))
    rows, lengths = members["rows"], _whole(path, "lengths", members["lengths"])
    names, units = header["columns"], header["units"]
    if (
        rows.ndim != 2
        or rows.shape[1] != len(names)
        or len(units) != len(names)
        or lengths.sum() != len(rows)
    ):
        raise RecordingError(
            f"{path}: rows {rows.shape}, {len(names)} columns, {len(units)} units and {len(lengths)} lengths with sum "
            f"{lengths.sum()} do not belong together"
        )
    if rows.dtype.kind not in "fiu":
        raise RecordingError(f"{path}: rows of {rows.dtype}, not of numbers")
    factors = scales(str(path), names, units, body, "time" in names)
    grounds = (
        _grounds(path, members, header, len(lengths))
        if body.map_size
        else [None] * len(lengths)
    )
    sessions = members.get("sessions", np.full(len(lengths), ""))
    if sessions.shape != lengths.shape or sessions.dtype.kind != "U":
        raise RecordingError(
            f"{path}: sessions {sessions.shape} of {sessions.dtype}, not a text for each drive"
        )
    rate = None if "time" in factors else float(header["rate"])
    if rate is not None and not 0 < rate < float("inf"):
        raise RecordingError(f"{path}: a rate of {rate:g} Hz; it must be positive")
    return [
        Table(
            f"{path} drive {number}",
            {
                name: part[:, names.index(name)].astype(float) * factor
                for name, factor in factors.items()
            },
            {"session": np.full(len(part), sessions[number])},
            rate,
            grounds[number],
        )
        for number, part in enumerate(np.split(rows, np.cumsum(lengths)[:-1]))
    ]


def _header(path: Path, member: np.ndarray, grounds: bool) -> dict[str, Any]:
    try:
        header = json.loads(str(member))
    except ValueError as error:
        raise RecordingError(f"{path}: the header is not JSON ({error})") from None
    if not isinstance(header, dict):
        raise RecordingError(f"{path}: the header is not a JSON object")
    for name, value in header.items():
        if name not in HEADER:
            raise RecordingError(f"{path}: {unknown_name(name, HEADER, 'the header')}")
        beyond = isinstance(value, int) and abs(value) > sys.float_info.max
        if not isinstance(value, HEADER[name]) or isinstance(value, bool) or beyond:
            raise RecordingError(f"{path}: '{name}' of the header is {value!r}")
    for name in (*WANTED, *(OF_GROUNDS if grounds else ())):
        if name not in header:
            raise RecordingError(f"{path}: the header has no '{name}'")
    if not all(
        isinstance(word, str) for word in (*header["columns"], *header["units"])
    ):
        raise RecordingError(
            f"{path}: columns and units of the header are not all text"
        )
    if grounds and header["height_unit"] not in UNITS["length"]:
        known = " or ".join(UNITS["length"])
        raise RecordingError(
            f"{path}: height_unit '{header['height_unit']}'; heights are in {known}"
        )
    return header


def _grounds(
    path: Path,
    members: Mapping[str, np.ndarray],
    header: Mapping[str, Any],
    drives: int,
) -> list[Ground]:
    """The ground of each drive."""
    heights, which = members["heights"], _whole(path, "ground", members["ground"])
    if heights.ndim != 3 or heights.dtype.kind not in "fiu":
        raise RecordingError(
            f"{path}: heights {heights.shape} of {heights.dtype}, not of numbers"
        )
    try:
        centres = np.asarray(header.get("centres", np.zeros((len(heights), 2))), float)
    except (ValueError, TypeError, OverflowError):
        raise RecordingError(
            f"{path}: centres of the header are not an x and a y for each ground"
        ) from None
    if (
        centres.shape != (len(heights), 2)
        or len(which) != drives
        or which.max() >= len(heights)
    ):
        raise RecordingError(
            f"{path}: {len(heights)} heights, but 'ground' of {len(which)} drives goes up to {which.max()} and centres "
            f"are {centres.shape}"
        )
    scale = UNITS["length"][header["height_unit"]]
    return [
        Ground(heights[n] * scale, header["spacing"], (float(x), float(y)))
        for n, (x, y) in ((n, centres[n]) for n in which)
    ]


def _whole(path: Path, name: str, member: np.ndarray) -> np.ndarray:
    if (
        member.ndim != 1
        or member.dtype.kind not in "iu"
        or not len(member)
        or member.min() < 0
    ):
        raise RecordingError(
            f"{path}: '{name}' of shape {member.shape} and {member.dtype}, not a row of whole numbers"
        )
    return member.astype(int)


def write_npz(path: Path, drives: Sequence[Drive], origin: str) -> None:
    """Pack drives: numbers in float32, each ground once, its heights in whole millimetres.

    Raises:
        ValueError: grounds of several shapes or spacings.
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
        np.hstack([d.states, np.vstack([d.actions, d.actions[-1:]])]).astype(np.float32)
        for d in drives
    ]
    members: dict[str, Any] = {
        "rows": np.vstack(rows),
        "lengths": np.array([len(part) for part in rows]),
        "sessions": np.array([drive.session for drive in drives]),
    }
    if body.map_size:
        grounds = [drive.ground for drive in drives if drive.ground is not None]
        heights = [
            np.round(1e3 * ground.heights).astype(np.int32) for ground in grounds
        ]
        if (
            len(
                {
                    (one.shape, ground.spacing)
                    for one, ground in zip(heights, grounds, strict=True)
                }
            )
            != 1
        ):
            raise ValueError("drives to pack have grounds of one shape and spacing")
        if max(np.abs(one).max() for one in heights) <= np.iinfo(np.int16).max:
            heights = [one.astype(np.int16) for one in heights]
        each = {one.tobytes(): one for one in heights}
        order = list(each)
        members |= {
            "ground": np.array([order.index(one.tobytes()) for one in heights]),
            "heights": np.stack(list(each.values())),
        }
        header |= {"spacing": grounds[0].spacing, "height_unit": "mm"}
    members["header"] = np.array(json.dumps(header))
    write_atomically(
        path, lambda file: np.savez_compressed(file, allow_pickle=False, **members)
    )
