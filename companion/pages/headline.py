"""The numbers of the README and of the book's first page, and where they are from.

`make headline` prints the numbers; `make figures` draws Figures 3 and 4 as files.
"""

from __future__ import annotations

import argparse
import json
import re
from pathlib import Path
from typing import NamedTuple

import pandas as pd

from companion.engine.store import Results
from companion.methods import COMPARED, FIGURE3, FOR_LITTLE
from companion.pages.page import glued, outputs
from companion.registry import grid
from companion.statistics import claims
from companion.statistics.savings import savings
from companion.studies.decisive import figure3, figure4, verdicts
from companion.studies.tuning import little_data_results
from companion.study import Study
from ownrobot.comparison.statistics import significant
from sidm.systems import PAPER_SYSTEMS

PRESET = "study"  # whose results the book shows
CLOSED_FORM = "least_squares"  # drawn beside the methods of Figure 3
DRAWN = (*COMPARED, *(name + FOR_LITTLE for name in COMPARED), FIGURE3[-1], CLOSED_FORM)
FIGURE = Path("book/static/figure3.png")  # in the README
FIRST_PAGE, NOTEBOOKS = Path("book/intro.md"), Path("notebooks")
#: A number of another page's notebook: its chapter and its name.
GLUED = re.compile(r"\{glue:text\}`\.\./notebooks/([\w-]+)\.ipynb::([\w-]+):s`")
AGAIN = re.compile(r"again: (?:`|<code>)(.*?)(?:`|</code>)")


class Stored(NamedTuple):
    """Stored results behind the README's numbers: a row for each trial."""

    frame: pd.DataFrame  # of Figure 3 with CLOSED_FORM
    little: pd.DataFrame  # of the methods tuned for little data
    decisive: pd.DataFrame  # of the decisive experiment


#: Verdict on the SIDM's data ratio -> how both methods are trained.
TRAINED = {"R1": "as released (R)", "T2": "tuned (T)"}


def long_trained(decisive: pd.DataFrame) -> pd.DataFrame:
    """Verdicts TRAINED on the SIDM, for the systems that have their values."""
    ratios = verdicts.data_ratios(decisive).query("method == 'sidm'")
    return ratios[ratios.verdict.isin(list(TRAINED))].dropna(subset="value")


def headline_numbers(stored: Stored) -> list[str]:
    """The README's numbers: how many times less novice data the methods need.

    They are, each for one system after the other: ratio and ends of its interval for an
    SIDM with 5 min, trained as the authors' code trains; the same with each method at
    its best; the same for fine-tuning with 5 min.
    """
    frame, _, decisive = stored
    long = long_trained(decisive)[["value", "low", "high"]]
    finetuned = savings(frame, [FIGURE3[-1]])
    finetuned = finetuned[finetuned.novice_minutes == claims.CLAIMED_AT]
    tables = long, finetuned[["ratio", "low", "high"]]
    values = [value for table in tables for value in table.to_numpy().ravel()]
    return [significant(value, 2) for value in values]


def stored_results(data: str | Path = "data") -> Stored:
    """Stored results behind the README's numbers."""
    study, store = Study(PRESET, data), Results("results")
    trials = [
        *grid(PRESET, "3", data=data),
        *(t for t in grid(PRESET, "references", data=data) if t.method == CLOSED_FORM),
    ]
    return Stored(
        store.frame(trials),
        little_data_results(study, store, PAPER_SYSTEMS),
        verdicts.results(study, store),
    )


class Headline(NamedTuple):
    """A number of the README and its origin."""

    number: str  # as in the README
    quantity: str  # what the number is
    rows: int  # number of trials that it is computed from
    command: str  # runs these trials again


def headlines(stored: Stored) -> list[Headline]:
    """The README's numbers with their origin, in the order of `headline_numbers`."""
    frame, _, decisive = stored
    ratio = "times the novice data that training alone needs, against"
    ends = ("", ", lower end of the 95 % interval", ", upper end of it")
    finetuned = frame[frame.method.isin((COMPARED[1], FIGURE3[-1]))]
    long = long_trained(decisive)
    groups = [
        (f"an SIDM with 5 min, {how}", decisive, "decisive", systems)
        for verdict, how in TRAINED.items()
        if len(systems := long[long.verdict == verdict].system)
    ]
    groups.append(("fine-tuning with 5 min", finetuned, "3", PAPER_SYSTEMS))
    origins = []
    for method, trials, figure, systems in groups:
        command = f"companion run --preset {PRESET} --figure {figure}"
        for system in systems:
            count = int((trials.system == system).sum())
            for end in ends:
                origins.append((f"{system}: {ratio} {method}{end}", count, command))
    numbers = headline_numbers(stored)
    return [
        Headline(number, *origin)
        for number, origin in zip(numbers, origins, strict=True)
    ]


class Glued(NamedTuple):
    """A number of the first page, which a chapter's notebook computes from rows."""

    number: str
    chapter: str
    name: str  # of the number in the notebook
    command: str  # runs the trials of that part of the chapter again


def glued_numbers(text: str, notebooks: Path = NOTEBOOKS) -> list[Glued]:
    """The numbers that a page's Markdown takes from notebooks, in the page's order.

    ValueError says that a notebook has no such number, or no line of provenance after
    it.
    """
    return [
        _glued(notebooks / f"{chapter}.ipynb", name)
        for chapter, name in GLUED.findall(text)
    ]


def _glued(notebook: Path, name: str) -> Glued:
    number = None
    for output in outputs(notebook):
        if output.get("metadata", {}).get("scrapbook", {}).get("name") == name:
            number = glued(notebook, name)
        commands = AGAIN.findall(json.dumps(output.get("data", {})))
        if number is not None and commands:
            return Glued(number, notebook.stem, name, commands[-1])
    raise ValueError(f"{notebook.stem} glues no '{name}' before a line of provenance")


def show() -> None:
    """Print each number of the README and the first page, and what makes it again."""
    for headline in headlines(stored_results()):
        print(f"{headline.number:>6}  {headline.quantity}")
        print(f"        {headline.rows} rows of results/; again: {headline.command}")
    for number, chapter, name, command in glued_numbers(FIRST_PAGE.read_text()):
        print(f"{number:>6}  {name}")
        print(f"        companion notebook {chapter}; its rows again: {command}")


def main(figures: Path = Path("_build/figures")) -> None:
    """Draw Figures 3 and 4 into a folder, and Figure 3 for the README."""
    quick, _, decisive = stored_results()
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
