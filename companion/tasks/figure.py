"""The benchmark's scores on a page: labelled dots, texts and a table."""

from __future__ import annotations

import shlex
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from companion.figures.dots import dot_plot
from companion.tasks.catalogue import GROUPS, MINUTES
from companion.tasks.run import records
from companion.tasks.scores import (
    REFERENCE,
    mean_ratio,
    results_frame,
    scores_by_group,
)
from ownrobot.comparison.statistics import Interval
from ownrobot.methods.registry import METHODS

TICKS = 0.6, 0.8, 1.0, 1.2, 1.5, 2.0, 3.0
#: Methods of the figure, in the order of its rows.
SHOWN: tuple[str, ...] = (
    "gp",
    "trees",
    "novice_only",
    "corrected",
    "trees_corrected",
    "least_squares_corrected",
    "pretrain_finetune",
    "sidm",
)
#: Names of rows below the headings.
ROWS = {
    "novice_only": "recurrent network",
    "least_squares_corrected": "least squares, corrected",
    "gp_corrected": "the same by a Gaussian process",
    "trees_corrected": "trees, corrected by trees",
    "pretrain_finetune": "network, fine-tuned",
    "corrected": "network, corrected",
    "sidm": "SIDM",
}
#: What the figure shows, for readers who cannot see it.
WORDS = "Losses of eight methods, divided by that of least squares, with intervals"
HEADINGS = {False: "novice's drives alone", True: "with the expert's drives"}


def library_rows(results: Path | str) -> pd.DataFrame:
    """The stored trials of the library's methods, see `scores.results_frame`."""
    rows = results_frame(records(results).all())
    return rows[rows.method.isin(METHODS)]


def task_names(group: str, minutes: Iterable[float] = MINUTES) -> list[str]:
    """The tasks of a group with some sizes; real robots have sizes of their own."""
    sizes = set(minutes)
    return [t.name for t in GROUPS[group] if not t.pair or t.minutes in sizes]


def task_groups(minutes: float) -> dict[str, list[str]]:
    """Titles of the figure's plots -> the tasks of each."""
    return {
        f"held struts, {minutes:g} min": task_names("held", [minutes]),
        f"free struts, {minutes:g} min": task_names("free", [minutes]),
        "two real robots": task_names("quick"),
    }


def figure(scores: pd.DataFrame, methods: Sequence[str] = SHOWN) -> Figure:
    """The scores of methods with their intervals, those without an expert first.

    Args:
        scores: made by `scores_by_group`; the groups are the titles of the plots.
        methods: names of the methods, in the order of the rows.
    """
    methods = sorted(methods, key=lambda name: METHODS[name].needs_expert)
    rows = [
        (
            panel,
            ROWS.get(name, METHODS[name].label),
            HEADINGS[METHODS[name].needs_expert],
            name,
            *scores.at[name, panel],
        )
        for panel in scores
        for name in methods
        if name in scores.index and isinstance(scores.at[name, panel], Interval)
    ]
    names = ["panel", "row", "group", "method", "value", "low", "high"]
    dots = pd.DataFrame(rows, columns=names)
    return dot_plot(dots, "loss / that of least squares", ticks=TICKS)


def ratio_text(
    rows: pd.DataFrame, method: str, tasks: Iterable[str], value: str = "loss"
) -> str:
    """A method's loss or error divided by that of least squares, as text."""
    mean = mean_ratio(rows, method, tasks, value)
    return "not run" if np.isnan(mean.value) else mean.text(2)


def score_texts(
    rows: pd.DataFrame, groups: Mapping[str, Iterable[str]]
) -> pd.DataFrame:
    """A table for a page: a row for each method, a column for each group of tasks."""
    scores = scores_by_group(rows, groups)
    texts = scores.map(lambda s: s.text(2) if isinstance(s, Interval) else "-")
    texts.insert(0, "method", [METHODS[name].label for name in texts.index])
    return texts


def provenance(rows: pd.DataFrame, folders: Sequence[str]) -> str:
    """The line below the figure: how many trials, and the command that runs them."""
    methods = REFERENCE, *SHOWN
    words = ["companion", "bench", *methods, "--tasks", "all", *folders]
    rows = rows[rows.method.isin(methods)]
    link = '<a href="../book/benchmark-table.html">every trial and its seconds</a>'
    count = f"{len(rows)} trials of {rows.task.nunique()} tasks; {link}; again"
    made = count if len(rows) else "No trials stored; run"
    return f'<p class="provenance">{made}: <code>{shlex.join(words)}</code>.</p>'
