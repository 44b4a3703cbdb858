"""CSV files of programs that export the topics of a robot, as PlotJuggler does.

Their columns have other names: a time in one or two columns, and parts of messages as
`/odom/pose/pose/position/x`, which are read as the same part of a bag is.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from ownrobot.recordings.csv_text import TextTable, as_float, text_of
from ownrobot.recordings.messages import (
    QUATERNION,
    columns_of_part,
    plain_name,
    unit_of,
)
from sidm.drives import yaw_of

SECONDS = re.compile(r"(.*?)(secs?|seconds)", re.IGNORECASE)
NANOSECONDS = re.compile(r"(.*?)(nsecs?|nanosecs?|nanoseconds)", re.IGNORECASE)
#: Names of a time -> its unit where the file gives none; '': the file must give it.
CLOCKS = {"__time": "s", "%time": "ns", "timestamp": "", "stamp": ""}
#: The path of a number of a joint, or of a message that is one number -> its column.
NAMED = re.compile(r"(?:.*/)?(?:joint_states/)?(?P<name>[^/]+)/(velocity|data)")


def read_text(path: Path) -> TextTable:
    """Read a CSV file's header and cells, with the names that other files have."""
    table = text_of(path)
    if "time" not in table.names:
        _name_time(table)
    _name_parts(table)
    _add_yaw(table)
    return table


def _name_time(table: TextTable) -> None:
    """Call a table's stamps `time`, where they have another name or two columns."""
    names, units, cells = table.names, table.units, table.cells
    for name, unit in CLOCKS.items():
        if names.count(name) == 1:
            number = names.index(name)
            if units[number] or unit:
                names[number], units[number] = "time", units[number] or unit
                return
    seconds = {found[1]: n for n in names if (found := SECONDS.fullmatch(n))}
    for name in names:
        found = NANOSECONDS.fullmatch(name)
        if not found or found[1] not in seconds:
            continue
        first, second = names.index(seconds[found[1]]), names.index(name)
        try:
            whole = ([int(as_float(c)) for c in cells[n]] for n in (first, second))
            stamps = [str(s * 10**9 + ns) for s, ns in zip(*whole, strict=True)]
        except ValueError:
            return
        names[first], units[first], cells[first] = "time", "ns", stamps
        del names[second], units[second], cells[second]
        return


def _name_parts(table: TextTable) -> None:
    """Name columns as in a bag, where no two paths in messages mean the same."""
    names, units = table.names, table.units
    meant = {name: _column_of(name) for name in names}
    inertial = {meant[name] for name in names if "angular_velocity" in name}
    for name in names:
        if "twist" in name and meant[name] in inertial:
            meant[name] = ""
    columns = list(meant.values())
    for number, name in enumerate([*names]):
        column = meant[name]
        if column and columns.count(column) == 1 and column not in names:
            names[number] = column
            if not name.endswith("data"):  # the message of a number has no unit
                units[number] = units[number] or unit_of(column)


def _column_of(path: str) -> str:
    """The name of the column that a path in a message means; '' for other names."""
    parts = path.strip("/").replace(".", "/")
    part, slash, axis = parts.rpartition("/")
    if not slash:
        return ""
    if column := columns_of_part(part).get(axis):
        return column
    found = NAMED.fullmatch(parts)
    return plain_name(found["name"]) if found else ""


def _add_yaw(table: TextTable) -> None:
    """Add the yaw of a table's quaternions, where it has no other yaw."""
    names = table.names
    if "yaw" in names or any(names.count(name) != 1 for name in QUATERNION):
        return
    parts = [[*map(as_float, table.column(name))] for name in QUATERNION]
    table.cells.append([*map(str, yaw_of(np.transpose(parts)))])
    table.names.append("yaw")
    table.units.append("rad")
