"""The command `companion bench`."""

from __future__ import annotations

import argparse
import math
from pathlib import Path

from companion.cluster import executor_at
from ownrobot.command_line import whole_number
from sidm.config import ConfigError

CLOSE = 0.02  # of an error: a tree may split elsewhere after another rounding
TASKS_HELP = (
    "a task's name; 'quick' (real robots), 'held', 'free', 'family' or 'bodies' "
    "(simulated robots); or 'all' (%(default)s)"
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `companion bench` to its parser."""
    add = parser.add_argument
    text = "a method of 'ownrobot fit', or FILE.py:CLASS; of all rows if none is given"
    add("methods", metavar="METHOD", nargs="*", help=text)
    add("--tasks", metavar="NAME", default="quick", help=TASKS_HELP)
    add("--seeds", type=whole_number, metavar="N", help="trials of a task")
    add("--data", metavar="DIR", default="data", help="simulated motion (%(default)s)")
    text = "folder of the rows (%(default)s)"
    add("--results", metavar="DIR", default="results", help=text)
    text = "trials at the same time (%(default)s)"
    add("--workers", type=whole_number, metavar="N", default=1, help=text)
    add("--dask", metavar="ADDRESS", help="scheduler of a Dask cluster")
    text = "most seconds of a trial (an hour)"
    add("--limit", type=_seconds, metavar="S", help=text)
    add("--retry", action="store_true", help="run trials that failed again")
    add("--page", metavar="FILE", help="write the table as a page")
    add("--csv", metavar="FILE", help="write the tasks' rows as CSV")
    add("--list", action="store_true", help="print the tasks' cards and run nothing")
    text = "run the quickest stored trial of the method again, and compare its errors"
    add("--check", action="store_true", help=text)


def _seconds(text: str) -> float:
    """Parse a number of seconds above 0."""
    number = float(text)
    if not 0 < number < math.inf:
        raise argparse.ArgumentTypeError(f"seconds must be above 0, not {text}")
    return number


def run_bench(arguments: argparse.Namespace) -> int:
    """Run `companion bench`: it runs what is missing and prints the table.

    Returns:
        The exit status: 1 when a trial is missing, or a check finds other errors.
    """
    from companion.tasks.catalogue import SEEDS, card, find_tasks
    from companion.tasks.run import entries, newest, records, run
    from companion.tasks.trial import LIMIT

    if (arguments.check or arguments.list) and (arguments.page or arguments.csv):
        raise ConfigError("--page and --csv write the table: without --check or --list")
    for name in ("seeds", "dask", "limit", "retry"):
        if getattr(arguments, name) and not arguments.methods:
            raise ConfigError(f"--{name} is for methods that are run: name one")
    tasks, seeds = find_tasks(arguments.tasks), arguments.seeds or SEEDS
    limit, store = arguments.limit or LIMIT, records(arguments.results)
    if arguments.list:
        results = store.all()
        print("\n\n".join(card(task, results) for task in tasks))
        return 0
    if arguments.check:
        stored = [row for row in store.all() if row.about.task in tasks]
        return _check(arguments, stored, limit)
    status = 0
    if arguments.methods:
        with executor_at(arguments.dask) as executor:
            run(
                arguments.methods,
                tasks,
                seeds=seeds,
                data=arguments.data,
                results=arguments.results,
                workers=arguments.workers,
                executor=executor,
                limit=limit,
                retry=arguments.retry,
            )
        wanted = entries(arguments.methods, tasks, seeds)
        status = int(any(store.get(entry) is None for entry in wanted))
    rows = newest(arguments.results, arguments.methods)
    _print_table(arguments, [row for row in rows if row.about.task in tasks])
    return status


def _print_table(arguments: argparse.Namespace, results) -> None:
    """Print the table of the tasks' rows, and write the page and the rows."""
    from companion.tasks.catalogue import SEEDS
    from companion.tasks.page import write_page
    from companion.tasks.scores import REFERENCE, results_frame, score_table
    from companion.tasks.trial import NO_FAILURE

    if not results:
        raise ConfigError(
            f"{arguments.results}: no rows of these tasks are there; name a method"
        )
    frame = results_frame(results)
    table = score_table(frame)
    saved = zip(table.pop("data_bound"), table.data_ratio, strict=True)
    table["data_ratio"] = [
        "" if math.isnan(ratio) else f"{bound}{ratio:.3g}" for bound, ratio in saved
    ]
    print(table.to_string(index=False, float_format="{:.3g}".format, na_rep=""))
    if REFERENCE not in frame[frame.status == "ok"].method.to_numpy():
        print(f"note: scores are ratios to {REFERENCE}; run it on these tasks, too")
    elif table.score.isna().any():
        print(f"note: a score needs all {SEEDS} seeds of a task, and no failure")
    elif table.tasks.nunique() > 1:
        print("note: some scores are over fewer tasks; '--tasks' takes a group")
    for row in frame[~frame.status.isin(NO_FAILURE)].itertuples():
        where = f"{row.method}, {row.task}, seed {row.seed}"
        print(f"note: {where}: {row.status}: {row.message}")
    if arguments.csv:
        frame.to_csv(arguments.csv, index=False, float_format="%.6g")
    if arguments.page:
        write_page(frame, Path(arguments.page))
        print(f"page: {arguments.page}")


def _check(arguments: argparse.Namespace, results, limit: float) -> int:
    """Run the quickest stored trial of each method again, and compare the errors."""
    from companion.tasks.run import check

    if not arguments.methods:
        raise ConfigError("--check needs a method, as FILE.py:CLASS")
    status = 0
    for name in arguments.methods:
        stored, again = check(name, results, arguments.data, arguments.workers, limit)
        print(f"{name}, {stored.about.task.name}, seed {stored.about.seed}:")
        same = True
        for value in ("status", "loss", "position", "heading"):
            before, now = getattr(stored, value), getattr(again, value)
            close = _close(before, now)
            same &= close
            line = f"  {value:8}  stored {_shown(before)}, again {_shown(now)}"
            print(line if close else f"{line}: NOT the same")
        if same:
            print("  the same")
        status |= not same
    return int(status)


def _shown(value: float | str | None) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value or "none")


def _close(stored: float | str | None, again: float | str | None) -> bool:
    """Whether values agree to what another processor's rounding makes of an error."""
    if isinstance(stored, float) and isinstance(again, float):
        return abs(stored - again) <= CLOSE * abs(stored)
    return stored == again
