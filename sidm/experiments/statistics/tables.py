"""Rows of the store as arrays, as a line that says where they come from, and as a table of what they cost."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Callable, Iterable, Sequence
from html import escape
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from sidm.experiments.engine.provenance import here
from sidm.experiments.engine.store import Results, Row
from sidm.experiments.methods import COMPARED
from sidm.experiments.study import Study
from sidm.experiments.trials import Trial

if TYPE_CHECKING:
    import pandas as pd


class Losses(NamedTuple):
    """The part of a study that is complete: S seeds, K methods, M sizes."""

    minutes: np.ndarray  # (M,) rising
    values: np.ndarray  # (S, K, M)
    seeds: np.ndarray  # (S,)


def validation_loss(row: Row) -> float:
    """Equation (1) on the validation set."""
    return row.outcome.validation_loss


def final_position_error(row: Row) -> float:
    """Deviation at the end of the rollouts, m."""
    return row.outcome.position_error[-1]


def gather(
    rows: Iterable[Row],
    system: str,
    methods: Sequence[str] = COMPARED,
    value: Callable[[Row], float] = validation_loss,
) -> Losses:
    """A value of every row of a system as an array over seeds, methods and sizes.

    Sizes that a method lacks altogether are left out, then seeds that lack one of the sizes.

    Raises:
        ValueError: two different trials stand for the same point, as rows of an ablation do.
    """
    cells: dict[tuple[int, str, float], float] = {}
    trials: dict[tuple[int, str, float], Trial] = {}
    for row in rows:
        point = row.trial.seed, row.trial.method, row.trial.novice_minutes
        if row.trial.system == system:
            if trials.setdefault(point, row.trial) != row.trial:
                raise ValueError(f"two different trials of {row.trial}; gather the rows of one figure at a time")
            cells[point] = value(row)
    sizes = sorted(set.intersection(*({size for _, method, size in cells if method == m} for m in methods)))
    every = sorted({seed for seed, _, _ in cells})
    seeds = [seed for seed in every if all((seed, m, size) in cells for m in methods for size in sizes)]
    values = [[[cells[seed, m, size] for size in sizes] for m in methods] for seed in seeds]
    array = np.array(values, float).reshape(len(seeds), len(methods), len(sizes))
    return Losses(np.array(sizes, float), array, np.array(seeds, int))


def provenance_line(rows: Sequence[Row], command: str = "") -> str:
    """Under each result: trials, dates, code version, device, hours, and the `command` that makes it again."""
    if not rows:
        return "No trials stored" + (f"; `{command}` runs them." if command else ".")
    made = [row.provenance for row in rows]
    days = sorted({one.date[:10] for one in made})
    codes = sorted({f"{one.version} ({one.source})" for one in made})
    stale = sum(one.stale for one in made)
    elsewhere = sum(one.other_data != () for one in made)
    parts = [
        f"{len(rows)} trials",
        " to ".join(dict.fromkeys((days[0], days[-1]))),
        f"code {', '.join(codes)}" + (f", {stale} of them made by older code" if stale else "")
        + (f", {elsewhere} from data made again on another machine" if elsewhere else ""),
        f"{', '.join(sorted({one.device for one in made}))}, {sum(one.seconds for one in made) / 3600:.2g} h in all",
    ]
    return "; ".join(parts) + (f"; again: `{command}`." if command else ".")


def costs(frame: pd.DataFrame) -> pd.DataFrame:
    """What trials took, by system and method: mean and longest, min, and the most memory, MiB."""
    found = frame.assign(minutes=frame.seconds / 60).groupby(["system", "method"]).agg(
        trials=("seed", "size"), mean=("minutes", "mean"), longest=("minutes", "max"), memory=("peak_memory", "max")
    ).reset_index()  # fmt: skip
    names = {"mean": "mean (min)", "longest": "longest (min)", "memory": "peak memory (MiB)"}
    return found.assign(memory=found.memory.round().astype(int)).rename(columns=names)


def differences(trial: Trial, base: Trial) -> str:
    """What tells a trial's network and trainings from another's, as 'p_expert=0.25'; empty when nothing does."""
    words = []
    for part in ("network", "training", "pretraining"):
        one, other = getattr(trial, part), getattr(base, part)
        if one is not None and other is not None:
            names = [field.name for field in dataclasses.fields(one)]
            words += [f"{n}={getattr(one, n)}" for n in names if getattr(one, n) != getattr(other, n)]
    return ", ".join(dict.fromkeys(words))


def overview(store: Results, trials: Iterable[Trial], study: Study) -> list[str]:
    """A line a system, method, size and configuration: how many of a study's trials are stored and stale, mean loss."""
    points: dict[Trial, list[Trial]] = {}
    for trial in trials:
        points.setdefault(trial.replace(seed=0), []).append(trial)
    lines = []
    for first, group in points.items():
        rows = store.rows(group)
        words = f"{first.system}  {first.method:<18}{first.novice_minutes:>6g} min  stored {len(rows)} of {len(group)}"
        if rows:
            loss = np.mean([validation_loss(row) for row in rows])
            words += f"  stale {sum(row.provenance.stale for row in rows)}  loss {loss:.4g}"
        variant = differences(first, study.trial(first.system, first.method, first.novice_minutes))
        lines.append(words + (f"  ({variant})" if variant else ""))
    return lines


def stored_line(store: Results, trials: Sequence[Trial], command: str) -> str:
    """How many of `trials` are stored, by system where some are missing, and the `command` that runs those."""
    missing = store.missing(trials)
    if not missing:
        return f"All {len(trials)} trials are stored."
    systems = dict.fromkeys(trial.system for trial in trials)
    parts = [f"{sum(trial.system == system for trial in missing)} of {system}" for system in systems]
    return f"{len(missing)} of {len(trials)} trials are missing ({', '.join(parts)}); `{command}` runs them."


def provenance_block(rows: Sequence[Row], command: str = "") -> str:
    """`provenance_line` as Markdown of the book's class `provenance`."""
    return f'<div class="provenance">\n\n{provenance_line(rows, command)}\n\n</div>'


def provenance_html(rows: Sequence[Row], command: str = "") -> str:
    """The same in HTML, for a page that takes results over from another."""
    words = re.sub("`(.*?)`", r"<code>\1</code>", escape(provenance_line(rows, command), quote=False))
    return f'<div class="provenance"><p>{words}</p></div>'


def made_here(chapter: str, kind: str = "training") -> str:
    """The same of what a page has simulated or computed itself of a kind of work, by the chapter's name."""
    one = here(0.0, 1, kind=kind)
    words = f"Made by this page; {one.date[:10]}; code {one.version} ({one.source}); {one.device}"
    again = f"again: `sidm notebook {chapter} _build/{chapter}.ipynb`."
    return f'<div class="provenance">\n\n{words}; {again}\n\n</div>'


def markdown_table(head: Sequence[str], lines: Iterable[Sequence[object]]) -> str:
    """A table for a page, floats with 3 significant digits, a dash for NaN; a sentence when there is no line."""
    body = [[_words(cell) for cell in line] for line in lines]
    if not body:
        return "No trials stored."
    rule = ["---"] * len(head)
    return "\n".join(f"| {' | '.join(line)} |" for line in (head, rule, *body)) + "\n"


def on_page(table: pd.DataFrame) -> str:
    """A table for a page in Markdown, as `markdown_table` writes it."""
    return markdown_table(list(table.columns), table.itertuples(index=False))


def in_html(table: pd.DataFrame) -> str:
    """The same in HTML, for a page that takes the table over from another."""
    return html_table(list(table.columns), table.itertuples(index=False))


def html_table(head: Sequence[str], lines: Iterable[Sequence[object]]) -> str:
    """The same in HTML, for a page that takes the table over from another."""
    rows = [("th", head), *(("td", line) for line in lines)]
    if len(rows) == 1:
        return "<p>No trials stored.</p>"
    cells = ("".join(f"<{tag}>{escape(_words(cell))}</{tag}>" for cell in row) for tag, row in rows)
    return f'<table class="table">{"".join(f"<tr>{row}</tr>" for row in cells)}</table>'


def html_list(lines: Iterable[str]) -> str:
    """Lines of text as a list in HTML."""
    return f"<ul>{''.join(f'<li>{escape(line, quote=False)}</li>' for line in lines)}</ul>"


def _words(cell: object) -> str:
    if isinstance(cell, float):
        return "-" if np.isnan(cell) else f"{cell:.3g}"
    return str(cell)


def spread(frame: pd.DataFrame, by: Sequence[str], value: str = "validation_loss") -> pd.DataFrame:
    """For each group that the columns `by` make: number of trials, mean, minimum and maximum of a value."""
    found = frame.groupby(list(by))[value].agg(["size", "mean", "min", "max"]).reset_index()
    return found.rename(columns={"size": "trials", "min": "minimum", "max": "maximum"})


#: Name and unit of each of the 13 components of y.
COMPONENTS = (
    *((f"translation {axis}", "m") for axis in "xyz"),
    *((f"quaternion {axis}", "-") for axis in "xyzw"),
    *((f"linear velocity {axis}", "m/s") for axis in "xyz"),
    *((f"angular velocity {axis}", "rad/s") for axis in "xyz"),
)


def component_lines(columns: Iterable[Sequence[Sequence[float]]]) -> list[tuple]:
    """A line a component of y: name, unit, and its root mean square error in each column.

    Args:
        columns: component losses (S, 13) of S trials each, as `Outcome.component_losses`.

    Returns:
        13 lines, or none without columns.
    """
    errors = [np.sqrt(np.mean(np.asarray(losses, float), axis=0)).tolist() for losses in columns]
    return [(*named, *line) for named, *line in zip(COMPONENTS, *errors, strict=True)] if errors else []
