"""The README's headline numbers, and Figures 3 and 4 as files; `make figures` makes both anew."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from sidm.experiments.claims import claims_table, markdown
from sidm.experiments.figures import figure3, figure4
from sidm.experiments.grids import grid
from sidm.experiments.methods import COMPARED
from sidm.experiments.store import Results, Row
from sidm.experiments.tables import gather, markdown_table
from sidm.systems import SYSTEMS

PRESET = "laptop"  # the study that the book shows
BEGIN, END = "<!-- headline: begin (made by `make figures`) -->", "<!-- headline: end -->"


def loss_table(rows: Sequence[Row]) -> str:
    """Mean validation loss, equation (1), of both methods at every size that both have, as a Markdown table."""
    lines: list[tuple[object, ...]] = []
    for system in SYSTEMS:
        losses = gather(rows, system, COMPARED)
        for size, minutes in enumerate(losses.minutes if losses.values.size else ()):
            means = losses.values[:, :, size].mean(axis=0)
            lines.append((system, f"{minutes:g} min", *(f"{mean:.3f}" for mean in means), len(losses.values)))
    return markdown_table(("system", "novice data", "with SIDM", "without SIDM", "seeds"), lines)


def headline(rows: Sequence[Row]) -> str:
    """The block of the README between its two marks."""
    table, claims = loss_table(rows).strip(), markdown(claims_table(rows)).strip()
    return f"{BEGIN}\n{table}\n\n{claims}\n\nFrom {len(rows)} stored trials of the `{PRESET}` preset.\n{END}"


def refresh(text: str, rows: Sequence[Row]) -> str:
    """A README's text with its headline block made anew from the stored rows."""
    pattern = re.compile(re.escape(BEGIN) + ".*?" + re.escape(END), re.DOTALL)
    if len(pattern.findall(text)) != 1:
        raise ValueError(f"the README must have one block from '{BEGIN}' to '{END}'")
    return pattern.sub(lambda _: headline(rows), text)


def main(readme: Path = Path("README.md"), figures: Path = Path("_build/figures")) -> None:
    """Refresh the README and draw Figures 3 and 4 into a folder."""
    rows = Results("results").rows(grid(PRESET, "3"))
    readme.write_text(refresh(readme.read_text(encoding="utf-8"), rows), encoding="utf-8")
    figures.mkdir(parents=True, exist_ok=True)
    figure3(rows).savefig(figures / "figure3.png")
    figure4(Results("results").rows(grid(PRESET, "4"))).savefig(figures / "figure4.png")
    print(f"{readme} and {figures}/figure3.png, figure4.png are drawn from {len(rows)} stored trials")


if __name__ == "__main__":
    main()
