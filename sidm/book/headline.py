"""The README's headline numbers, and Figures 3 and 4 as files; `make figures` makes both anew."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from sidm.experiments.engine.store import Results, Row
from sidm.experiments.figures.curves import figure3
from sidm.experiments.figures.paths import figure4
from sidm.experiments.figures.style import METHOD_STYLES
from sidm.experiments.grids import grid
from sidm.experiments.methods import FIGURE3
from sidm.experiments.statistics.claims import figure3_claims, figure4_claims, markdown
from sidm.experiments.statistics.tables import gather, markdown_table
from sidm.systems import SYSTEMS

PRESET = "laptop"  # the study that the book shows
BESIDE = ("least_squares",)  # beside the methods of Figure 3
BEGIN, END = "<!-- headline: begin (made by `make figures`) -->", "<!-- headline: end -->"


def loss_table(rows: Sequence[Row]) -> str:
    """Mean validation loss, equation (1), at every size that all methods have, as a Markdown table.

    The methods are Figure 3's, and least squares where their rows are there.
    """
    there = {row.trial.method for row in rows}
    methods = [*FIGURE3, *(name for name in BESIDE if name in there)]
    lines: list[tuple[object, ...]] = []
    for system in SYSTEMS:
        losses = gather([row for row in rows if row.trial.method in methods], system, methods)
        for size, minutes in enumerate(losses.minutes if losses.values.size else ()):
            means = losses.values[:, :, size].mean(axis=0)
            lines.append((system, f"{minutes:g} min", *(f"{mean:.3f}" for mean in means), len(losses.values)))
    labels = (METHOD_STYLES[method]["label"] for method in methods)
    return markdown_table(("system", "novice data", *labels, "seeds"), lines)


def headline(rows: Sequence[Row], rows4: Sequence[Row] = ()) -> str:
    """The block of the README between its two marks, from the rows of Figures 3 and 4."""
    claims = markdown([*figure3_claims(rows), *figure4_claims(rows4)]).strip()
    trials = len({row.trial.key for row in (*rows, *rows4)})
    source = f"From {trials} stored trials of the `{PRESET}` preset."
    return f"{BEGIN}\n{loss_table(rows).strip()}\n\n{claims}\n\n{source}\n{END}"


def refresh(text: str, rows: Sequence[Row], rows4: Sequence[Row] = ()) -> str:
    """A README's text with its headline block made anew from the stored rows; ValueError without one such block."""
    pattern = re.compile(re.escape(BEGIN) + ".*?" + re.escape(END), re.DOTALL)
    if len(pattern.findall(text)) != 1:
        raise ValueError(f"the README must have one block from '{BEGIN}' to '{END}'")
    return pattern.sub(lambda _: headline(rows, rows4), text)


def stored_rows(data: str | Path = "data") -> tuple[list[Row], list[Row]]:
    """What the README tells of: the rows of Figure 3 and its reference, and those of Figure 4."""
    rows, beside, rows4 = (Results("results").rows(grid(PRESET, name, data=data)) for name in ("3", "references", "4"))
    return [*rows, *(row for row in beside if row.trial.method in BESIDE)], rows4


def main(readme: Path = Path("README.md"), figures: Path = Path("_build/figures")) -> None:
    """Refresh the README and draw Figures 3 and 4 into a folder."""
    rows, rows4 = stored_rows()
    readme.write_text(refresh(readme.read_text(encoding="utf-8"), rows, rows4), encoding="utf-8")
    figures.mkdir(parents=True, exist_ok=True)
    figure3(rows).savefig(figures / "figure3.png")
    figure4(rows4).savefig(figures / "figure4.png")
    print(f"{readme} and {figures}/figure3.png, figure4.png are drawn from {len(rows)} stored trials")


if __name__ == "__main__":
    main()
