"""The README's numbers, which are those of the store, and Figures 3 and 4 as files; `make figures` draws them."""

from __future__ import annotations

import argparse
import re
from pathlib import Path
from typing import NamedTuple

import pandas as pd

from companion.engine.store import Results
from companion.figures.curves import figure3
from companion.figures.paths import figure4
from companion.grids import grid
from companion.methods import COMPARED, FIGURE3, FOR_LITTLE
from companion.statistics.claims import saved
from companion.statistics.savings import savings
from companion.studies.tuning import best_alone, for_little
from companion.study import Study
from sidm.systems import SYSTEMS

PRESET = "study"  # the study that the book shows
BESIDE = "least_squares"  # beside the methods of Figure 3
DRAWN = (*COMPARED, *(name + FOR_LITTLE for name in COMPARED), FIGURE3[-1], BESIDE)
FIGURE = Path("book/static/figure3.png")  # that the README shows


def numbers(frame: pd.DataFrame, little: pd.DataFrame) -> list[str]:
    """What the README says in bold: what an SIDM saves, what one tuned for least data, and what fine-tuning.

    Args:
        frame: of Figure 3; of both systems, one after the other.
        little: of the methods that were tuned for little data.
    """
    both = [saved(frame, system) for system in SYSTEMS]
    ratios = [
        one[name].iloc[0]
        for one in both
        if len(one)
        for name in ("value", "low", "high")
    ]
    least = savings(
        pd.concat([little, best_alone(frame, little)]), ["sidm" + FOR_LITTLE]
    ).drop_duplicates("system")
    finetuned = savings(frame, ["pretrain_finetune"]).drop_duplicates("system").ratio
    return [
        f"{one:.2g}"
        for one in (
            *ratios,
            *least[["ratio", "low", "high"]].to_numpy().ravel(),
            *finetuned,
        )
    ]


def stated(text: str) -> list[str]:
    """The numbers that a README has in bold, in their order."""
    return re.findall(r"\*\*([\d.]+)\*\*", text)


def stored(
    data: str | Path = "data",
) -> tuple[pd.DataFrame, pd.DataFrame, pd.DataFrame]:
    """The results of Figure 3, with what stands beside it, of methods tuned for little data, and of Figure 4."""
    study, store = Study(PRESET, data), Results("results")
    trials = {name: grid(PRESET, name, data=data) for name in ("3", "references", "4")}
    beside = [trial for trial in trials["references"] if trial.method == BESIDE]
    little = for_little(study, store, SYSTEMS)
    return store.frame([*trials["3"], *beside]), little, store.frame(trials["4"])


class Headline(NamedTuple):
    """A number of the README, where it is from, and how its rows are made again."""

    number: str  # as the README has it
    words: str  # what it is
    rows: int  # trials that it is computed from
    command: str  # that makes them again


def headlines(frame: pd.DataFrame, little: pd.DataFrame) -> list[Headline]:
    """The README's numbers in their order; `frame` and `little` as of `numbers`."""
    run = f"companion run --preset {PRESET} --figure"
    ends = ("", ", lower end of the 95 % interval", ", upper end of it")
    alone = "times the novice data that training alone needs, against"
    compared = (
        frame[frame.method.isin(COMPARED)],
        frame[frame.method.isin((COMPARED[1], FIGURE3[-1]))],
    )
    asked = [
        (f"{alone} an SIDM with 5 min", ends, compared[0], f"{run} 3"),
        (
            f"{alone} an SIDM with 1 min, both tuned for little data",
            ends,
            little,
            f"{run} little-data",
        ),
        (f"{alone} fine-tuning with 1 min", ends[:1], compared[1], f"{run} 3"),
    ]
    found = [
        (f"{system}: {words}{end}", int((rows.system == system).sum()), command)
        for words, parts, rows, command in asked
        for system in SYSTEMS
        for end in parts
    ]
    return [
        Headline(number, *said)
        for number, said in zip(numbers(frame, little), found, strict=True)
    ]


def show() -> None:
    """Print every number of the README with its rows and the command that makes these again."""
    frame, little, _ = stored()
    for one in headlines(frame, little):
        print(
            f"{one.number:>6}  {one.words}\n        {one.rows} rows of results/; again: {one.command}"
        )


def main(figures: Path = Path("_build/figures")) -> None:
    """Draw Figures 3 and 4 into a folder, and Figure 3 for the README."""
    frame, little, frame4 = stored()
    figures.mkdir(parents=True, exist_ok=True)
    for path in (figures / "figure3.png", FIGURE):
        figure3(pd.concat([frame, little]), methods=DRAWN).savefig(path)
    figure4(frame4).savefig(figures / "figure4.png")
    drawn = len(frame) + len(little) + len(frame4)
    print(
        f"{FIGURE} and {figures}/figure3.png, figure4.png are drawn from {drawn} trials"
    )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument(
        "--numbers",
        action="store_true",
        help="print the README's numbers and where they are from",
    )
    (show if parser.parse_args().numbers else main)()
