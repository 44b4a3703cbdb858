"""The numbers of the README and of the book's first page, and where they are from.

`make headline` prints the numbers; `make figures` draws Figures 3 and 4 as files.
"""

from __future__ import annotations

import argparse
import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import pandas as pd

from companion.engine.store import Results
from companion.methods import COMPARED, FIGURE3, FOR_LITTLE
from companion.pages.page import glued
from companion.registry import grid
from companion.statistics import claims
from companion.statistics.savings import savings
from companion.studies.decisive import figure3, figure4, verdicts
from companion.study import Study
from ownrobot.comparison.statistics import significant

PRESET = "study"  # whose results the book shows
CLOSED_FORM = "least_squares"  # drawn beside the methods of Figure 3
DRAWN = (*COMPARED, *(name + FOR_LITTLE for name in COMPARED), FIGURE3[-1], CLOSED_FORM)
FIGURE = Path("book/static/figure3.png")  # in the README
FIRST_PAGE, NOTEBOOKS = Path("book/intro.md"), Path("notebooks")
#: A number of another page's notebook: its chapter and its name.
GLUED = re.compile(r"\{glue:text\}`\.\./notebooks/([\w-]+)\.ipynb::([\w-]+):s`")
#: Verdict on the SIDM's data ratio -> how both methods are trained.
TRAINED = {"R1": "as released (R)", "T2": "tuned (T)"}


class Stored(NamedTuple):
    """Stored results behind the README's numbers: a row for each trial."""

    quick: pd.DataFrame  # of Figure 3 with CLOSED_FORM
    decisive: pd.DataFrame  # of the decisive experiment


class Headline(NamedTuple):
    """A number of the README and its origin."""

    number: str  # as in the README
    quantity: str  # what the number is
    rows: int  # number of trials that it is computed from
    command: str  # runs these trials again


def stored_results(data: str | Path = "data") -> Stored:
    """Stored results behind the README's numbers."""
    study, store = Study(PRESET, data), Results("results")
    references = grid(PRESET, "references", data=data)
    trials = grid(PRESET, "3", data=data)
    trials = [*trials, *(t for t in references if t.method == CLOSED_FORM)]
    return Stored(store.frame(trials), verdicts.results(study, store))


def headlines(stored: Stored) -> list[Headline]:
    """How many times less novice data the methods need, each with its interval.

    The ratio and its ends, each for one system after the other: an SIDM with 5 min,
    trained as the authors' code trains; the same with each method at its best;
    fine-tuning with 5 min.
    """
    quick, decisive = stored
    judged = verdicts.data_ratios(decisive).query("method == 'sidm'")
    groups = [
        (f"an SIDM with 5 min, {how}", "decisive", decisive, rows)
        for verdict, how in TRAINED.items()
        for rows in [judged[judged.verdict == verdict]]
    ]
    tuned = savings(quick, [FIGURE3[-1]]).rename(columns={"ratio": "value"})
    tuned = tuned[tuned.novice_minutes == claims.CLAIMED_AT]
    compared = quick[quick.method.isin((COMPARED[1], FIGURE3[-1]))]
    groups.append(("fine-tuning with 5 min", "3", compared, tuned))
    ends = {"value": "", "low": ", lower end of the 95 % interval"}
    ends["high"] = ", upper end of it"
    found = []
    for method, figure, trials, ratios in groups:
        for row in ratios.dropna(subset="value").itertuples():
            needed = "times the novice data that training alone needs, against"
            rows = int((trials.system == row.system).sum())
            command = f"companion run --preset {PRESET} --figure {figure}"
            for name, end in ends.items():
                number = significant(getattr(row, name), 2)
                quantity = f"{row.system}: {needed} {method}{end}"
                found.append(Headline(number, quantity, rows, command))
    return found


class Glued(NamedTuple):
    """A number of the first page, which a chapter's notebook computes from rows."""

    number: str
    chapter: str
    name: str  # of the number in the notebook
    command: str  # runs the trials of that part of the chapter again


def glued_numbers(text: str, notebooks: Path = NOTEBOOKS) -> Iterator[Glued]:
    """The numbers that a page's Markdown takes from notebooks, in the page's order.

    ValueError says that a notebook has no such number.
    """
    for chapter, name in GLUED.findall(text):
        number, command = glued(notebooks / f"{chapter}.ipynb", name)
        yield Glued(number, chapter, name, command)


def show() -> None:
    """Print each number of the README and the first page, and what makes it again."""
    for number, quantity, rows, command in headlines(stored_results()):
        print(f"{number:>6}  {quantity}")
        print(f"        {rows} rows of results/; again: {command}")
    for number, chapter, name, command in glued_numbers(FIRST_PAGE.read_text()):
        print(f"{number:>6}  {name}")
        print(f"        companion notebook {chapter}; its rows again: {command}")


def main(figures: Path = Path("_build/figures")) -> None:
    """Draw Figures 3 and 4 into a folder, and Figure 3 for the README."""
    quick, decisive = stored_results()
    figures.mkdir(parents=True, exist_ok=True)
    losses, paths = figure3.table(decisive, quick=quick), figure4.table(decisive)
    for path in (figures / "figure3.png", FIGURE):
        figure3.figure(losses).savefig(path)
    figure4.figure(paths).savefig(figures / "figure4.png")
    print(f"{FIGURE} and {figures}/figure3.png are drawn from {len(losses)} trials,")
    print(f"{figures}/figure4.png from {len(paths)}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument(
        "--numbers",
        action="store_true",
        help="print the README's numbers and where they are from",
    )
    (show if parser.parse_args().numbers else main)()
