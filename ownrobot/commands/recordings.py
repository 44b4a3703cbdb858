"""The commands that look at recordings: check and body."""

from __future__ import annotations

import argparse
import statistics
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from ownrobot.command_line import AddCommand
from ownrobot.commands.options import DRIVES, add_reading_options
from sidm.config import ConfigError, counted

if TYPE_CHECKING:
    from sidm.body import Body
    from sidm.drives import Drive

CHECK_EXAMPLES = """\
  ownrobot check drives/ --body robot.yaml
  ownrobot check drive.bag --body robot.yaml --topics /odom /cmd_vel"""
BODY_EXAMPLES = """\
  ownrobot body drive.bag --out robot.yaml
  ownrobot body drive.csv"""


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
    from ownrobot.body_file import as_body
    from ownrobot.recordings.frames import faults_together
    from ownrobot.recordings.reading import as_paths, drives_of_paths
    from ownrobot.recordings.table import Findings, RecordingError
    from sidm.drives import minutes_of

    body, paths = as_body(arguments.body), as_paths(arguments.drives)
    findings = Findings(skip=True, doubtful=not arguments.skip_bad)
    drives: list[Drive] = []
    together: list[str] = []
    try:
        drives = drives_of_paths(paths, body, arguments.topics, findings)
    except RecordingError as error:
        together.append(str(error))
    if drives:
        together += faults_together(", ".join(map(str, paths)), drives, body)
        lengths, rate = list(map(len, drives)), statistics.median(findings.rates)
        number = counted(len(drives), "drive")
        sessions = counted(len({drive.session for drive in drives}), "session")
        print(
            f"{', '.join(arguments.drives)}: {number} without a fault of {sessions}, "
            f"{minutes_of(drives):.3g} min"
        )
        print(
            f"{min(lengths)} to {max(lengths)} steps of {1 / body.rate:g} s in a drive,"
            f" median {round(statistics.median(lengths))}; rows come at {rate:.3g} Hz, "
            f"and the body has {body.rate:g} Hz"
        )
        print(_table(drives, body))
    for note in findings.notes:
        print(f"note: {note}")
    for fault in findings.faults:
        print(f"{'left out' if arguments.skip_bad else 'wrong'}: {fault}")
    for fault in together:
        print(f"wrong: {fault}")
    if not findings.faults and not together:
        noted = "nothing would be refused; see the notes above"
        print(noted if findings.notes else "nothing is wrong")
    elif findings.faults and drives and not arguments.skip_bad:
        print("--skip-bad leaves out each drive or file that is wrong")
    wrong = together or (findings.faults and not arguments.skip_bad)
    return 1 if wrong or not drives else 0


def _table(drives: Sequence[Drive], body: Body) -> str:
    """A line for each column of the drives, below a line of titles."""
    import numpy as np
    import pandas as pd

    from sidm.body import SI

    states = np.concatenate([drive.states for drive in drives])
    actions = np.concatenate([drive.actions for drive in drives])
    parts = [pd.DataFrame(states), pd.DataFrame(actions)]
    frame = pd.concat(parts, axis=1, ignore_index=True)
    table = frame.agg(["min", "median", "max"]).T.assign(std=frame.std(ddof=0))
    columns = (*body.state, *body.actions)
    width = max(len("column"), *(len(name) for name, _ in columns))
    units = max(len("unit"), *(len(SI[unit]) for _, unit in columns))
    titles = "".join(f"{kind:>11}" for kind in table)
    lines = [f"{'column':{width}}  {'unit':{units}}{titles}"]
    # rounding errors of a pose at the origin are 0
    for (name, unit), row in zip(columns, table.round(12).to_numpy(), strict=True):
        numbers = "".join(f"{value:11.4g}" for value in row)
        lines.append(f"{name:{width}}  {SI[unit]:{units}}{numbers}")
    return "\n".join(lines)


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
