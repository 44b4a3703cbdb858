"""The README's headline numbers, and Figures 3 and 4 as files; `make figures` makes both anew."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

from sidm.book.pages import on_page
from sidm.experiments.engine.store import Results
from sidm.experiments.figures.curves import figure3
from sidm.experiments.figures.paths import figure4
from sidm.experiments.figures.style import METHOD_STYLES
from sidm.experiments.grids import grid
from sidm.experiments.methods import FIGURE3
from sidm.experiments.statistics.claims import figure3_claims, figure4_claims, written
from sidm.experiments.statistics.pairs import complete
from sidm.systems import SYSTEMS

if TYPE_CHECKING:
    import pandas as pd

PRESET = "laptop"  # the study that the book shows
BESIDE = ("least_squares",)  # beside the methods of Figure 3
BEGIN, END = "<!-- headline: begin (made by `make figures`) -->", "<!-- headline: end -->"


def loss_table(frame: pd.DataFrame) -> pd.DataFrame:
    """Mean validation loss, equation (1), at every size that all methods have.

    The methods are Figure 3's, and least squares where their results are there.
    """
    import pandas as pd

    methods = [*FIGURE3, *(name for name in BESIDE if name in set(frame.method))]
    labels = [METHOD_STYLES[method]["label"] for method in methods]
    lines: list[tuple] = []
    for system in SYSTEMS:
        losses = complete(frame, system, methods)
        for size, minutes in enumerate(losses.minutes if losses.values.size else ()):
            means = [f"{mean:.3f}" for mean in losses.values[:, :, size].mean(axis=0)]
            lines.append((system, f"{minutes:g} min", *means, len(losses.values)))
    return pd.DataFrame(lines, columns=["system", "novice data", *labels, "seeds"])


def headline(frame: pd.DataFrame, frame4: pd.DataFrame) -> str:
    """The block of the README between its two marks, from the results of Figures 3 and 4."""
    import pandas as pd

    claims = pd.concat([figure3_claims(frame), figure4_claims(frame4)])
    tables = [on_page(table).strip() for table in (loss_table(frame), written(claims))]
    source = f"From {len(frame.index.union(frame4.index))} stored trials of the `{PRESET}` preset."
    return "\n".join([BEGIN, tables[0], "", tables[1], "", source, END])


def refresh(text: str, frame: pd.DataFrame, frame4: pd.DataFrame) -> str:
    """A README's text with its headline block made anew from stored results; ValueError without one such block."""
    pattern = re.compile(re.escape(BEGIN) + ".*?" + re.escape(END), re.DOTALL)
    if len(pattern.findall(text)) != 1:
        raise ValueError(f"the README must have one block from '{BEGIN}' to '{END}'")
    return pattern.sub(lambda _: headline(frame, frame4), text)


def stored(data: str | Path = "data") -> tuple[pd.DataFrame, pd.DataFrame]:
    """What the README tells of: the results of Figure 3 and its reference, and those of Figure 4."""
    trials = {name: grid(PRESET, name, data=data) for name in ("3", "references", "4")}
    beside = [trial for trial in trials["references"] if trial.method in BESIDE]
    store = Results("results")
    return store.frame([*trials["3"], *beside]), store.frame(trials["4"])


def main(readme: Path = Path("README.md"), figures: Path = Path("_build/figures")) -> None:
    """Refresh the README and draw Figures 3 and 4 into a folder."""
    frame, frame4 = stored()
    readme.write_text(refresh(readme.read_text(encoding="utf-8"), frame, frame4), encoding="utf-8")
    figures.mkdir(parents=True, exist_ok=True)
    figure3(frame).savefig(figures / "figure3.png")
    figure4(frame4).savefig(figures / "figure4.png")
    print(f"{readme} and {figures}/figure3.png, figure4.png are drawn from {len(frame)} stored trials")


if __name__ == "__main__":
    main()
