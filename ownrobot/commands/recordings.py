"""The commands that look at recordings: check and body."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ownrobot.command_line import AddCommand
from ownrobot.commands.options import DRIVES, add_reading_options
from sidm.config import ConfigError, counted

CHECK_EXAMPLES = """\
  ownrobot check drives/ --body robot.yaml
  ownrobot check drive.bag --body robot.yaml --topics /odom /cmd_vel"""
BODY_EXAMPLES = """\
  ownrobot body drive.bag --out robot.yaml
  ownrobot body drive.csv"""
KINDS = ("min", "median", "max", "std")  # numbers of a column in the table


def add_check(add: AddCommand) -> None:
    """Add `ownrobot check`."""
    text = (
        "What is in recorded drives, and all that is wrong there. Exit status 1 if "
        "something is that 'ownrobot fit' would refuse."
    )
    check = add("check", run_check, text, CHECK_EXAMPLES)
    check.add_argument("drives", metavar="PATH", nargs="+", help=DRIVES)
    text = "what the drives are made of, YAML"
    check.add_argument("--body", metavar="FILE", required=True, help=text)
    add_reading_options(check)


def add_body(add: AddCommand) -> None:
    """Add `ownrobot body`."""
    text = "A first file of a robot's body, guessed from a recording, for you to check."
    body = add("body", run_body, text, BODY_EXAMPLES)
    text = "a CSV file, a ROS bag, or a folder of them"
    body.add_argument("drives", metavar="PATH", help=text)
    text = "topics of the bag that are read, where several could be meant (all)"
    body.add_argument("--topics", metavar="NAME", nargs="+", default=[], help=text)
    text = "where to write (standard output)"
    body.add_argument("--out", metavar="FILE", help=text)


def run_check(arguments: argparse.Namespace) -> int:
    """Run `ownrobot check`: it prints what is there, and a line for each fault."""
    from ownrobot.recordings import inspect_drives

    skip_bad, where = arguments.skip_bad, ", ".join(arguments.drives)
    found = inspect_drives(arguments.drives, arguments.body, arguments.topics, skip_bad)
    print(*_report(where, found, skip_bad), sep="\n")
    wrong = found["common_faults"] or (found["faults"] and not skip_bad)
    return 1 if wrong or not found["drives"] else 0


def _report(where: str, found: Mapping[str, Any], skip_bad: bool) -> list[str]:
    """The lines of `ownrobot check`."""
    lines = []
    if found["drives"]:
        shortest, median, longest = found["steps"]
        lines = [
            f"{where}: {counted(found['drives'], 'drive')} without a fault of "
            f"{counted(found['sessions'], 'session')}, {found['minutes']:.3g} min",
            f"{shortest} to {longest} steps of {1 / found['body_rate']:g} s in a drive,"
            f" median {median}; rows come at {found['row_rate']:.3g} Hz, and the body "
            f"has {found['body_rate']:g} Hz",
            *_table(found["columns"]),
        ]
    lines += [f"note: {note}" for note in found["notes"]]
    kind = "left out" if skip_bad else "wrong"
    lines += [f"{kind}: {fault}" for fault in found["faults"]]
    lines += [f"wrong: {fault}" for fault in found["common_faults"]]
    if not found["faults"] and not found["common_faults"]:
        noted = "nothing would be refused; see the notes above"
        lines.append(noted if found["notes"] else "nothing is wrong")
    elif found["faults"] and found["drives"] and not skip_bad:
        lines.append("--skip-bad leaves out each drive or file that is wrong")
    return lines


def _table(columns: Sequence[Mapping[str, Any]]) -> list[str]:
    """A line for each column of the drives, below a line of titles."""
    width = max(len("column"), *(len(column["name"]) for column in columns))
    units = max(len("unit"), *(len(column["unit"]) for column in columns))
    titles = "".join(f"{kind:>11}" for kind in KINDS)
    lines = [f"{'column':{width}}  {'unit':{units}}{titles}"]
    for column in columns:
        # rounding errors of a pose at the origin are 0
        values = [round(column[kind], 12) for kind in KINDS]
        numbers = "".join(f"{value:11.4g}" for value in values)
        lines.append(f"{column['name']:{width}}  {column['unit']:{units}}{numbers}")
    return lines


def run_body(arguments: argparse.Namespace) -> int:
    """Run `ownrobot body`: it prints or writes the guessed body."""
    from ownrobot.recordings import guess_body
    from sidm.storage import write_atomically

    out = arguments.out and Path(arguments.out)
    if out and out.exists():
        raise ConfigError(f"{out}: there is such a file; give --out another name")
    text = guess_body(arguments.drives, arguments.topics).text
    if out:
        write_atomically(out, lambda file: file.write(text.encode()))
        print(f"{out}: check it, then run 'ownrobot check'")
    else:
        sys.stdout.write(text)
    return 0
