"""The command `ownrobot compare`."""

from __future__ import annotations

import argparse
import os
from pathlib import Path
from typing import Any

from ownrobot.command_line import AddCommand, whole_number
from ownrobot.commands.options import (
    DRIVES,
    add_robot_options,
    add_settings,
    methods_text,
)
from ownrobot.commands.tables import write_csv
from sidm.config import ConfigError, parse_changes

EXAMPLES = """\
  ownrobot compare drives/ --body robot.yaml
  ownrobot compare mine.bag --expert others/ --body robot.yaml \\
      --methods least_squares trees sidm --out comparison"""
MOST_WORKERS = 8


def add_compare(add: AddCommand) -> None:
    """Add `ownrobot compare`."""
    text = (
        "Which method suits a robot: each learns from a part of the sessions and is "
        "evaluated on the others. It can be interrupted; the same command resumes it."
    )
    examples = f"{EXAMPLES}\n\nmethods:\n{methods_text()}"
    compare = add("compare", run_compare, text, examples)
    compare.add_argument("drives", metavar="PATH", nargs="+", help=DRIVES)
    add_robot_options(compare)
    text = "methods that are compared (those that can learn these robots)"
    compare.add_argument("--methods", metavar="NAME", nargs="+", default=[], help=text)
    text = "parts of the sessions, each held out once (%(default)s)"
    number: dict[str, Any] = {"type": whole_number, "metavar": "N"}
    compare.add_argument("--folds", default=4, help=text, **number)
    text = "how often the sessions are divided anew, with another seed (%(default)s)"
    compare.add_argument("--repeats", default=3, help=text, **number)
    text = "seed of the first repeat (%(default)s)"
    compare.add_argument("--seed", type=int, default=0, help=text)
    text = "one setting of networks or training, as hidden=64; may be given again"
    add_settings(compare, text)
    workers = min(MOST_WORKERS, os.cpu_count() or 1)
    text = "processes that fit at the same time (%(default)s)"
    compare.add_argument("--workers", default=workers, help=text, **number)
    text = "folder of the tables, the report and unfinished work (%(default)s)"
    compare.add_argument("--out", metavar="DIR", default="comparison", help=text)


def run_compare(arguments: argparse.Namespace) -> int:
    """Run `ownrobot compare`: print the table and the answer, and write the report."""
    from ownrobot.comparison.run import compare
    from sidm.storage import write_atomically

    out = Path(arguments.out)
    if not arguments.out.strip() or (out.exists() and not out.is_dir()):
        raise ConfigError(f"'{out}' is no folder; name one for the comparison")
    if (out / "model.json").exists():
        raise ConfigError(f"{out} has a model; name another folder for the comparison")
    out.mkdir(parents=True, exist_ok=True)
    write_atomically(out / "comparison.csv", lambda file: None)  # before long work
    names = "expert methods body expert_body folds repeats seed workers topics skip_bad"
    comparison = compare(
        arguments.drives,
        settings=parse_changes(arguments.changes),
        folder=out,
        **{name: getattr(arguments, name) for name in names.split()},
    )
    print(comparison.text())
    print(comparison.verdict.sentence)
    write_csv(str(out / "comparison.csv"), comparison.table)
    write_csv(str(out / "learning-curve.csv"), comparison.curve)
    comparison.report(out / "report.html")
    print(f"report: {out / 'report.html'}")
    return 0
