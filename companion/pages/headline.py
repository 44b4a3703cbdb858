"""The numbers of the README and of the book's first page, and where they are from.

`make headline` prints the numbers; `make figures` draws Figures 3 and 4 as files.
"""

from __future__ import annotations

import argparse
import re
from pathlib import Path

from companion.engine.store import Results
from companion.methods import COMPARED, FIGURE3, FOR_LITTLE
from companion.pages.page import glued
from companion.registry import grid
from companion.studies.decisive import figure3, figure4, verdicts
from companion.study import Study

PRESET = "study"  # whose results the book shows
CLOSED_FORM = "least_squares"  # drawn beside the methods of Figure 3
DRAWN = (*COMPARED, *(name + FOR_LITTLE for name in COMPARED), FIGURE3[-1], CLOSED_FORM)
FIGURE = Path("book/static/figure3.png")  # in the README
FIRST_PAGE, NOTEBOOKS = Path("book/intro.md"), Path("notebooks")
#: A number of another page's notebook: its chapter and its name.
GLUED = re.compile(r"\{glue:text\}`\.\./notebooks/([\w-]+)\.ipynb::([\w-]+):s`")
#: Numbers of the README in its order, each with its interval: chapter and name.
README = tuple(
    ("04-figure3", name)
    for name in (
        "released-saving",
        "released-saving-2",
        "tuned-saving",
        "system1-finetuned-5",
        "system2-finetuned-5",
    )
)


def show() -> None:
    """Print each number of the README and the first page, and what makes it again."""
    for chapter, name in (*README, *GLUED.findall(FIRST_PAGE.read_text())):
        number, command = glued(NOTEBOOKS / f"{chapter}.ipynb", name)
        print(f"{number:>6}  {name}")
        print(f"        companion notebook {chapter}; its rows again: {command}")


def main(figures: Path = Path("_build/figures")) -> None:
    """Draw Figures 3 and 4 into a folder, and Figure 3 for the README."""
    store = Results("results")
    references = (t for t in grid(PRESET, "references") if t.method == CLOSED_FORM)
    quick = store.frame([*grid(PRESET, "3"), *references])
    decisive = verdicts.results(Study(PRESET), store)
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
