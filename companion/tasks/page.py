"""The benchmark's table as one sortable page that needs no other file."""

from __future__ import annotations

import json
import string
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from companion.tasks.catalogue import GROUPS, TASKS
from companion.tasks.scores import pairwise, score_table, task_scores
from ownrobot.comparison.statistics import Interval
from sidm.storage import write_atomically

#: Groups of tasks as the page calls them.
TITLES = {
    "quick": "real robots",
    "held": "struts held by motors",
    "free": "free struts",
    "family": "robots of the family",
    "bodies": "other bodies",
}


def write_page(frame: pd.DataFrame, path: Path) -> None:
    """Write the page of a table of results, as `scores.results_frame` returns it.

    It has a table for each group of tasks with rows, and one for all.
    """
    rows = frame.sort_values(["method", "task", "seed"]).to_dict("records")
    values = {
        "groups": [_group(frame, *group) for group in groups_of(frame).items()],
        "rows": [_plain(row) for row in rows],
    }
    template = resources.files(__package__).joinpath("page.html").read_text("utf-8")
    page = string.Template(template).substitute(
        data=json.dumps(values, separators=(",", ":")).replace("</", "<\\/")
    )
    write_atomically(path, lambda file: file.write(page.encode()))


def groups_of(frame: pd.DataFrame) -> dict[str, list[str]]:
    """Title of each group of tasks with rows -> its tasks; several also as all."""
    present = set(frame.task)
    known = {
        TITLES[name]: [task.name for task in tasks if task.name in present]
        for name, tasks in GROUPS.items()
    }
    groups = {title: tasks for title, tasks in known.items() if tasks}
    everything = [*sum(groups.values(), []), *sorted(present - set(TASKS))]
    if list(groups.values()) != [everything]:
        groups["all tasks"] = everything
    return groups


def _group(frame: pd.DataFrame, title: str, tasks: list[str]) -> dict[str, Any]:
    """The tables of a group of tasks; scores by task are methods by tasks."""
    trials = frame[frame.task.isin(tasks)]
    table = score_table(trials)
    methods = list(table.method)
    scores = np.exp(task_scores(trials)).T.reindex(index=methods, columns=tasks)
    values = [[_number(value) for value in row] for row in scores.to_numpy(float)]
    return {
        "title": title,
        "names": tasks,
        "methods": [_method_row(row) for row in table.to_dict("records")],
        "tasks": {"tasks": tasks, "methods": methods, "values": values},
        "apart": _apart(trials, methods),
    }


def _method_row(row: dict[str, Any]) -> dict[str, Any]:
    """The values of a method's row, with those that are no plain number as text."""
    interval = Interval(row["score"], row["low"], row["high"])
    saved = f"{row['data_bound']}{row['data_ratio']:.2g}"
    texts = {"score": interval.text(3), "data_ratio": saved.replace("nan", "")}
    return _plain(row) | {"shown": texts}


def _apart(frame: pd.DataFrame, methods: list[str]) -> str:
    """Table of the pairs that are surely apart, as HTML."""
    pairs = pairwise(frame, methods)
    apart = pairs[pairs.apart]
    if not len(apart):
        return "<p>No two methods are surely apart.</p>"
    shown = apart.rename(columns={"first": "better", "second": "than"})
    shown = shown.drop(columns=["p", "apart"]).rename(columns={"p_holm": "p (Holm)"})
    return shown.to_html(index=False, border=0, float_format="{:.3g}".format)


def _plain(row: dict[str, Any]) -> dict[str, Any]:
    """Values that JSON has: a number that is missing is null."""
    return {name: _number(value) for name, value in row.items()}


def _number(value: Any) -> Any:
    if isinstance(value, str):
        return value
    number = float(value)
    return float(f"{number:.4g}") if np.isfinite(number) else None
