"""The worth of choices that the paper leaves open or the released code makes otherwise.

Figure 3's methods, as each was tuned, are trained with one choice changed at a time, on
the smallest dataset of the ablations; and with the released code's choices together, at
every size.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import pandas as pd

from companion.engine.store import Results
from companion.methods import CHOICES, FIGURE3, RELEASED
from companion.statistics.pairs import paired_comparison
from companion.studies.reproduction import with_repeats
from companion.study import Study
from companion.trials import Trial

#: Description of a choice -> changes of the preset, and the methods that it concerns.
Choices = Mapping[str, tuple[dict[str, Any], tuple[str, ...]]]

UNCHANGED = "as in Figure 3"


def changed(
    study: Study, system: str, choices: Choices = CHOICES
) -> dict[str, list[Trial]]:
    """The trials of a system with each of the choices changed, by the choice.

    Those of CHOICES are on a small dataset, those of RELEASED at every size.
    """
    small = study.preset.ablation_minutes[:1]
    every = study.preset.novice_minutes(system)
    return {
        choice: study.changed(**changes).points(
            system, methods, small if choice in CHOICES else every
        )
        for choice, (changes, methods) in choices.items()
    }


def trials(study: Study, system: str) -> list[Trial]:
    """Figure 3's methods on a small dataset with one choice changed at a time."""
    return sum(changed(study, system).values(), [])


def released(study: Study, system: str) -> list[Trial]:
    """Figure 3 with choices of the released code made together."""
    return sum(changed(study, system, RELEASED).values(), [])


def frame(
    study: Study, store: Results, systems: Iterable[str], choices: Choices = CHOICES
) -> pd.DataFrame:
    """Stored results by `choice`; the results of Figure 3 have the choice UNCHANGED."""
    parts = []
    for system in systems:
        figure3 = study.points(system, FIGURE3, study.preset.novice_minutes(system))
        grids = {UNCHANGED: figure3} | changed(study, system, choices)
        parts += [
            store.frame(trials, curves=True).assign(choice=choice)
            for choice, trials in grids.items()
        ]
    return pd.concat(parts)


def table(frame: pd.DataFrame, results: str | Path) -> pd.DataFrame:
    """Ratios of the losses with a choice changed to the losses of Figure 3.

    Repeated trials of Figure 3 in `results` stand in where the changed ones ran on
    motion that was simulated again. The table is made by `pairs.paired_comparison`, one
    row per system, method, size and choice; a ratio above 1 means that the choice of
    Figure 3 is better.
    """
    return paired_comparison(
        frame[frame.choice != UNCHANGED],
        with_repeats(frame[frame.choice == UNCHANGED], results),
        ["system", "method", "novice_minutes"],
        ["choice"],
    )
