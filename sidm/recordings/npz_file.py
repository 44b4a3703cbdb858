"""Many recordings in one .npz file: the rows of all one after the other, each ground once, and a header in JSON.

=========  ===============  ============================================================================
member     shape            what it is
=========  ===============  ============================================================================
rows       (R, C)           numbers
lengths    (N,)             rows of each recording
ground     (N,)             which of the grounds each drove on
heights    (M, H, W)        grounds, index [y, x]
header     ()               text: JSON with the names of HEADER
=========  ===============  ============================================================================
"""

from __future__ import annotations

import json
import sys
import zipfile
import zlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from sidm.body import UNITS
from sidm.config import unknown_name
from sidm.recordings.recording import ACTION, COLUMNS, RATE, STATE, Ground, Recording, RecordingError
from sidm.recordings.table import from_table
from sidm.storage import write_atomically

MEMBERS = ("rows", "lengths", "ground", "heights", "header")

#: Names of the header -> types.
HEADER: dict[str, tuple[type, ...]] = {
    "columns": (list,),  # names
    "units": (list,),  # one a column
    "rate": (int, float),  # rows a second, Hz
    "spacing": (int, float),  # of the grounds' grids, m
    "height_unit": (str,),  # m, cm or mm
    "origin": (str,),  # where the recordings are from, for people
    "centres": (list,),  # x and y of each ground's middle, m; all 0 unless given
}


def read_npz(path: Path) -> list[Recording]:
    """The recordings of a file; RecordingError names the first fault."""
    try:
        file = np.load(path, allow_pickle=False)
        if isinstance(file, np.ndarray):
            raise ValueError("it holds one array, as .npy files do")
        with file:
            members = {name: file[name] for name in file.files}
    except (OSError, ValueError, EOFError, zipfile.BadZipFile, zlib.error) as error:
        raise RecordingError(f"{path}: cannot be read as .npz ({str(error).splitlines()[0]})") from None
    for name in MEMBERS:
        if name not in members:
            raise RecordingError(f"{path}: member '{name}' is missing; a file of recordings has {', '.join(MEMBERS)}")
    header = _json_header(path, members["header"])
    rows, heights = members["rows"], members["heights"]
    lengths, ground = (_whole(path, name, members[name]) for name in ("lengths", "ground"))
    if rows.ndim != 2 or heights.ndim != 3 or len(ground) != len(lengths) or lengths.sum() != len(rows):
        raise RecordingError(
            f"{path}: rows {rows.shape}, heights {heights.shape}, {len(lengths)} lengths with sum {lengths.sum()} and "
            f"{len(ground)} grounds do not belong together"
        )
    if heights.dtype.kind not in "fiu":
        raise RecordingError(f"{path}: heights of {heights.dtype}, not of numbers")
    try:
        centres = np.asarray(header.get("centres", np.zeros((len(heights), 2))), float)
    except (ValueError, TypeError, OverflowError):
        raise RecordingError(f"{path}: centres of the header are not an x and a y for each ground") from None
    if centres.shape != (len(heights), 2) or not ((ground >= 0) & (ground < len(heights))).all():
        raise RecordingError(
            f"{path}: {len(heights)} heights, but 'ground' goes up to {ground.max()} and centres are {centres.shape}"
        )
    scale = UNITS["length"][header["height_unit"]]
    grounds = [
        Ground(h * scale, header["spacing"], (float(x), float(y))) for h, (x, y) in zip(heights, centres, strict=True)
    ]
    parts = np.split(rows, np.cumsum(lengths)[:-1])
    return [
        from_table(
            f"{path} recording {number}", header["columns"], header["units"], header["rate"], part, grounds[which]
        )
        for number, (part, which) in enumerate(zip(parts, ground, strict=True))
    ]


def _json_header(path: Path, member: np.ndarray) -> dict[str, Any]:
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
    for name in HEADER.keys() - {"centres"}:
        if name not in header:
            raise RecordingError(f"{path}: the header has no '{name}'")
    if not all(isinstance(word, str) for word in (*header["columns"], *header["units"])):
        raise RecordingError(f"{path}: columns and units of the header are not all text")
    if header["height_unit"] not in UNITS["length"]:
        known = " or ".join(UNITS["length"])
        raise RecordingError(f"{path}: height_unit '{header['height_unit']}'; heights are in {known}")
    return header


def _whole(path: Path, name: str, member: np.ndarray) -> np.ndarray:
    if member.ndim != 1 or member.dtype.kind not in "iu" or not len(member) or member.min() < 0:
        raise RecordingError(f"{path}: '{name}' of shape {member.shape} and {member.dtype}, not a row of whole numbers")
    return member.astype(int)


def write_recordings(path: str | Path, recordings: Sequence[Recording], origin: str) -> None:
    """Pack recordings into one .npz file: numbers in float32, each ground once, its heights in whole millimetres.

    Args:
        path: of the file.
        recordings: all with one spacing of their grounds.
        origin: a sentence for people: where they are from.

    Raises:
        ValueError: none, or grounds of several shapes or spacings.
        OSError: the file cannot be written; one line.
    """
    shapes = {(r.ground.heights.shape, r.ground.spacing) for r in recordings}
    if len(shapes) != 1:
        raise ValueError(f"recordings to pack have grounds of one shape and spacing, not of {len(shapes)}")
    millimetres = [np.round(1e3 * recording.ground.heights) for recording in recordings]
    small = max(np.abs(ground).max() for ground in millimetres) <= np.iinfo(np.int16).max
    heights = [ground.astype(np.int16 if small else np.int32) for ground in millimetres]
    grounds = {ground.tobytes(): ground for ground in heights}
    order = list(grounds)
    rows = [
        np.hstack([r.states, np.vstack([r.actions, r.actions[-1:]])]).astype(np.float32) for r in recordings
    ]  # fmt: skip
    columns = [*STATE, *ACTION]
    header = {
        "columns": columns, "units": [next(iter(UNITS[COLUMNS[name]])) for name in columns], "rate": RATE,
        "spacing": recordings[0].ground.spacing, "height_unit": "mm", "origin": origin,
    }  # fmt: skip
    members: dict[str, Any] = {
        "rows": np.vstack(rows),
        "lengths": np.array([len(part) for part in rows]),
        "ground": np.array([order.index(ground.tobytes()) for ground in heights]),
        "heights": np.stack(list(grounds.values())),
        "header": np.array(json.dumps(header)),
    }
    write_atomically(Path(path), lambda file: np.savez_compressed(file, allow_pickle=False, **members))
