"""Tables of results as Markdown or HTML, and the provenance line under a result."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from html import escape
from typing import TYPE_CHECKING

import numpy as np

from companion.engine.provenance import record_provenance
from companion.engine.store import Results
from companion.figures.style import system_label
from companion.trials import Trial

if TYPE_CHECKING:
    import pandas as pd


#: A cell that is the name of a pair of robots.
_SYSTEM = re.compile(r"system\d(_[a-z_]+)?")


def markdown_table(head: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """A table in Markdown, or a notice where there are no rows.

    Floats have 3 significant digits; NaN is a dash. A pair of robots has its name in
    words.
    """
    body = [[_cell_text(cell).replace("|", r"\|") for cell in row] for row in rows]
    if not body:
        return "No trials stored."
    rule = ["---"] * len(head)
    return "\n".join(f"| {' | '.join(row)} |" for row in (head, rule, *body)) + "\n"


def table_markdown(table: pd.DataFrame) -> str:
    """A pandas table in Markdown, in the form of `markdown_table`."""
    return markdown_table(list(table.columns), table.itertuples(index=False))


def titled_table(title: str, table: pd.DataFrame) -> str:
    """A pandas table in Markdown below a title, which may name a pair of robots."""
    return f"**{_cell_text(title)}**\n\n{table_markdown(table)}"


def tables_by_system(table: pd.DataFrame) -> str:
    """A table in Markdown for each `system` of a pandas table, below its name."""
    groups = table.groupby("system", sort=False)
    tables = [
        titled_table(str(name), rows.drop(columns="system")) for name, rows in groups
    ]
    return "\n".join(tables) or table_markdown(table)


def table_html(table: pd.DataFrame) -> str:
    """A pandas table in HTML, for a page that shows another page's table."""
    if not len(table):
        return "<p>No trials stored.</p>"
    rows = [_html_row(table.columns, "th")]
    rows += [_html_row(row, "td") for row in table.itertuples(index=False)]
    return f'<table class="table">{"".join(rows)}</table>'


def _html_row(cells: Iterable[object], tag: str) -> str:
    row = "".join(f"<{tag}>{escape(_cell_text(cell))}</{tag}>" for cell in cells)
    return f"<tr>{row}</tr>"


def _cell_text(cell: object) -> str:
    if isinstance(cell, float):
        return "-" if np.isnan(cell) else f"{cell:.3g}"
    text = str(cell)
    return system_label(text) if _SYSTEM.fullmatch(text) else text


def known_text(form: str, *values: float) -> str:
    """Numbers in a form such as '{:.1f} to {:.1f}', or 'not run' where one is NaN."""
    return "not run" if np.isnan(values).any() else form.format(*values)


def in_sentence(texts: Sequence[str], systems: Iterable[str] = ()) -> str:
    """Texts joined by 'and', with the names of pairs of robots in brackets, if any."""
    names = [f" ({system_label(name)})" for name in systems] or [""] * len(texts)
    return " and ".join(map("".join, zip(texts, names, strict=True))) or "not run"


def provenance_line(frame: pd.DataFrame, *commands: str) -> str:
    """Where results come from, as the line under a table or a figure.

    It has the number of trials, dates, versions of the code, devices, hours, and the
    commands that run the trials again. `frame` is made by `Results.frame`,
    `Records.frame` or both.
    """
    again = ", ".join(f"`{command}`" for command in commands)
    if not len(frame):
        return "No trials stored" + (f"; {again} runs them." if again else ".")
    days = sorted(frame.date.str[:10].unique())
    versions = zip(frame.version, frame.source, strict=True)
    codes = sorted({f"{version} ({source})" for version, source in versions})
    code = f"code {', '.join(codes)}"
    if stale := int(frame.stale.sum()):
        code += f", {stale} of them made by older code"
    if reproduced := int(frame.repeated.sum()):
        code += f", {reproduced} from data reproduced on another machine"
    devices = ", ".join(sorted(frame.device.unique()))
    parts = [
        f"{len(frame)} trials",
        " to ".join(dict.fromkeys((days[0], days[-1]))),
        code,
        f"{devices}, {frame.seconds.sum() / 3600:.2g} h in all",
    ]
    return "; ".join(parts) + (f"; again: {again}." if again else ".")


def provenance_block(frame: pd.DataFrame, *commands: str) -> str:
    """`provenance_line` in Markdown; the page first shows the number of trials only."""
    return _folded(provenance_line(frame, *commands))


def provenance_html(frame: pd.DataFrame, *commands: str) -> str:
    """`provenance_block` in HTML, for a page that shows another page's results."""
    line = escape(provenance_line(frame, *commands), quote=False)
    return _folded(re.sub("`(.*?)`", r"<code>\1</code>", line), "<p>{}</p>")


def made_here(command: str, kind: str = "training") -> str:
    """Provenance in Markdown of what a page has simulated or computed itself.

    `kind` of work is a name in `companion.numerics`.
    """
    origin = record_provenance(0.0, 1, kind=kind)
    return _folded(
        f"Made by this page; {origin.date[:10]}; "
        f"code {origin.version} ({origin.source}); {origin.device}; "
        f"again: `{command}`."
    )


def _folded(line: str, inside: str = "\n\n{}\n\n") -> str:
    """HTML that shows the line up to its first semicolon, and the rest on a click."""
    count, _, rest = line.partition("; ")
    summary = f"<summary>{count}</summary>"
    return f'<details class="provenance">{summary}{inside.format(rest)}</details>'


def stored_line(store: Results, trials: Sequence[Trial], *commands: str) -> str:
    """How many trials are stored, and the commands that run the missing ones."""
    missing = store.missing(trials)
    if not missing:
        return f"All {len(trials)} trials that this notebook can run are stored."
    counts = dict.fromkeys((trial.system for trial in trials), 0)
    for trial in missing:
        counts[trial.system] += 1
    by_system = ", ".join(
        f"{count} of {system_label(system)}" for system, count in counts.items()
    )
    listed = ", ".join(f"`{command}`" for command in commands)
    after = ""
    if any(command.startswith("companion run") for command in commands):
        after = ", after `companion collect` with the same options"
    return (
        f"{len(missing)} of {len(trials)} trials are missing ({by_system}); "
        f"{listed} runs them{after}."
    )


def stored_count(stored: int, total: int, things: str, command: str) -> str:
    """How many of a study's results are stored, and what makes the others."""
    if stored == total:
        return f"All {total} {things} are stored."
    return f"{stored} of {total} {things} are stored; `{command}` makes the others."
