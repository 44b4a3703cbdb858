"""CSV files of programs that export the topics of a robot, as PlotJuggler does.

Their columns have other names: a time in one or two columns, and parts of messages as
`/odom/pose/pose/position/x`, which are read as the same part of a bag is.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from ownrobot.recordings.csv_text import TextTable, as_float, text_of
from ownrobot.recordings.messages import unit_of
from sidm.drives import yaw_of

SECONDS = re.compile(r"(.*?)(secs?|seconds)", re.IGNORECASE)
NANOSECONDS = re.compile(r"(.*?)(nsecs?|nanosecs?|nanoseconds)", re.IGNORECASE)
CLOCKS = {"__time": "s", "%time": "ns"}  # of PlotJuggler and rostopic
QUATERNION = ("qx", "qy", "qz", "qw")

#: The end of a part's path in a message -> the column's name by the path's last word;
#: the first that fits counts.
PARTS = {
    "position": {name: name for name in "xyz"},
    "orientation": {"x": "qx", "y": "qy", "z": "qz", "w": "qw", "yaw": "yaw"},
    "angular_velocity": {"x": "wx", "y": "wy", "z": "yaw_rate"},
    "linear_acceleration": {"x": "ax", "y": "ay", "z": "az"},
    "twist/twist/linear": {"x": "vx", "y": "vy", "z": "vz"},
    "twist/twist/angular": {"x": "wx", "y": "wy", "z": "yaw_rate"},
    "linear": {"x": "linear", "y": "linear_y", "z": "linear_z"},
    "angular": {"x": "angular_x", "y": "angular_y", "z": "angular"},
}
#: The path of a number of a joint, or of a message that is one number -> its column.
NAMED = re.compile(r"(?:.*/)?(?:joint_states/)?(?P<name>[^/]+)/(velocity|data)")


def read_text(path: Path) -> TextTable:
    """Read a CSV file's header and cells, with the names that other files have."""
    table = text_of(path)
    return _with_topics(table if "time" in table.names else _with_time(table))


def _with_time(table: TextTable) -> TextTable:
    """The table with its stamps as `time`, where they have other names."""
    names, units = table.names, table.units
    for name, unit in CLOCKS.items():
        if names.count(name) == 1:
            number = names.index(name)
            return table._replace(
                names=[*names[:number], "time", *names[number + 1 :]],
                units=[*units[:number], units[number] or unit, *units[number + 1 :]],
            )
    for name in ("timestamp", "stamp"):
        if names.count(name) == 1 and units[names.index(name)]:
            renamed = ["time" if one == name else one for one in names]
            return table._replace(names=renamed)
    seconds = {found[1]: n for n in names if (found := SECONDS.fullmatch(n))}
    for name in names:
        found = NANOSECONDS.fullmatch(name)
        if not found or found[1] not in seconds:
            continue
        parts = [names.index(seconds[found[1]]), names.index(name)]
        try:
            whole = ([int(as_float(c)) for c in table.cells[n]] for n in parts)
            stamps = [str(s * 10**9 + ns) for s, ns in zip(*whole, strict=True)]
        except ValueError:
            break
        kept = [n for n in range(len(names)) if n not in parts]
        return table._replace(
            names=["time", *(names[n] for n in kept)],
            units=["ns", *(units[n] for n in kept)],
            cells=[stamps, *(table.cells[n] for n in kept)],
        )
    return table


def _with_topics(table: TextTable) -> TextTable:
    """The table with names of columns in place of paths in messages.

    A path keeps its name where another one means the same, save that the turning rate
    of an inertial sensor comes before that of the pose, as in a bag.
    """
    meant = {name: _column_of(name) for name in table.names}
    inertial = {meant[name] for name in table.names if "angular_velocity" in name}
    for name in table.names:
        if "twist" in name and meant[name] in inertial:
            meant[name] = ""
    columns = list(meant.values())
    names, units = list(table.names), list(table.units)
    for number, name in enumerate(table.names):
        column = meant[name]
        if column and columns.count(column) == 1 and column not in table.names:
            names[number] = column
            if not name.endswith("data"):  # the message of a number has no unit
                units[number] = units[number] or unit_of(column)
    return _with_yaw(table._replace(names=names, units=units))


def _column_of(path: str) -> str:
    """The name of the column that a path in a message means; '' for other names."""
    parts = path.strip("/").replace(".", "/")
    if "/" not in parts:
        return ""
    end, _, last = parts.rpartition("/")
    for part, names in PARTS.items():
        if f"/{end}".endswith(f"/{part}") and last in names:
            return names[last]
    found = NAMED.fullmatch(parts)
    return re.sub(r"\W", "_", found["name"]) if found else ""


def _with_yaw(table: TextTable) -> TextTable:
    """The table with the yaw of its quaternions, where it has no other yaw."""
    names = table.names
    if "yaw" in names or any(names.count(name) != 1 for name in QUATERNION):
        return table
    parts = [map(as_float, table.cells[names.index(name)]) for name in QUATERNION]
    yaw = yaw_of(np.array([*map(list, parts)]).T)
    return table._replace(
        names=[*names, "yaw"],
        units=[*table.units, "rad"],
        cells=[*table.cells, [*map(str, yaw)]],
    )
