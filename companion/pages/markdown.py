"""What pages show of results: tables as Markdown or HTML, and under each result a line of where it comes from."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from html import escape
from typing import TYPE_CHECKING

import numpy as np

from companion.engine.provenance import here
from companion.engine.store import Results
from companion.trials import Trial

if TYPE_CHECKING:
    import pandas as pd


def markdown_table(head: Sequence[str], lines: Iterable[Sequence[object]]) -> str:
    """A table for a page, floats with 3 significant digits, a dash for NaN; a notice when there is no line."""
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
    rows = [
        ("th", tuple(table.columns)),
        *(("td", line) for line in table.itertuples(index=False)),
    ]
    if len(rows) == 1:
        return "<p>No trials stored.</p>"
    cells = (
        "".join(f"<{tag}>{escape(_words(cell))}</{tag}>" for cell in row)
        for tag, row in rows
    )
    return f'<table class="table">{"".join(f"<tr>{row}</tr>" for row in cells)}</table>'


def _words(cell: object) -> str:
    if isinstance(cell, float):
        return "-" if np.isnan(cell) else f"{cell:.3g}"
    return str(cell)


def provenance_line(frame: pd.DataFrame, command: str = "") -> str:
    """Under each result: how many, dates, code version, device, hours, and the `command` that makes it again.

    Args:
        frame: of `Results.frame` or `Records.frame`, or both together.
        command: of the command line.
    """
    if not len(frame):
        return "No trials stored" + (f"; `{command}` runs them." if command else ".")
    days = sorted(frame.date.str[:10].unique())
    codes = sorted(
        {
            f"{version} ({source})"
            for version, source in zip(frame.version, frame.source, strict=True)
        }
    )
    stale, elsewhere = (
        int(frame.stale.sum()),
        int(frame.other_data.map(len).astype(bool).sum()),
    )
    parts = [
        f"{len(frame)} trials",
        " to ".join(dict.fromkeys((days[0], days[-1]))),
        f"code {', '.join(codes)}"
        + (f", {stale} of them made by older code" if stale else "")
        + (
            f", {elsewhere} from data reproduced on another machine"
            if elsewhere
            else ""
        ),
        f"{', '.join(sorted(frame.device.unique()))}, {frame.seconds.sum() / 3600:.2g} h in all",
    ]
    return "; ".join(parts) + (f"; again: `{command}`." if command else ".")


def provenance_block(frame: pd.DataFrame, command: str = "") -> str:
    """`provenance_line` as Markdown of the book's class `provenance`, folded behind how many trials there are."""
    return _folded(provenance_line(frame, command))


def provenance_html(frame: pd.DataFrame, command: str = "") -> str:
    """The same in HTML, for a page that takes results over from another."""
    words = re.sub(
        "`(.*?)`",
        r"<code>\1</code>",
        escape(provenance_line(frame, command), quote=False),
    )
    return _folded(words, "<p>{}</p>")


def made_here(chapter: str, kind: str = "training") -> str:
    """The same of what a page has simulated or computed itself of a kind of work, by the chapter's name."""
    one = here(0.0, 1, kind=kind)
    words = f"Made by this page; {one.date[:10]}; code {one.version} ({one.source}); {one.device}"
    again = f"again: `companion notebook {chapter} _build/{chapter}.ipynb`."
    return _folded(f"{words}; {again}")


def _folded(line: str, inside: str = "\n\n{}\n\n") -> str:
    """A line of provenance, folded behind what stands before its first semicolon; `inside` is Markdown's or HTML's."""
    count, _, rest = line.partition("; ")
    return f'<details class="provenance"><summary>{count}</summary>{inside.format(rest)}</details>'


def stored_line(store: Results, trials: Sequence[Trial], command: str) -> str:
    """How many of `trials` are stored, by system where some are missing, and the `command` that runs those."""
    missing = store.missing(trials)
    if not missing:
        return f"All {len(trials)} trials are stored."
    systems = dict.fromkeys(trial.system for trial in trials)
    parts = [
        f"{sum(trial.system == system for trial in missing)} of {system}"
        for system in systems
    ]
    return f"{len(missing)} of {len(trials)} trials are missing ({', '.join(parts)}); `{command}` runs them."


def stored_count(stored: int, asked: int, things: str, command: str) -> str:
    """How many `things` of a study are stored, and the `command` that makes the others."""
    if stored == asked:
        return f"All {asked} {things} are stored."
    return f"{stored} of {asked} {things} are stored; `{command}` makes the others."
