"""What choices are worth that the paper leaves open, or that the released code makes otherwise.

Figure 3's methods are trained with one choice changed at a time, on the small size of
the ablations, as each was tuned; and with the released code's choices together, at
every size.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import pandas as pd

from companion.engine.store import Results
from companion.methods import CHOICES, FIGURE3, RELEASED
from companion.statistics.pairs import beside
from companion.study import Study
from companion.trials import Trial

Choices = Mapping[str, tuple[dict[str, Any], tuple[str, ...]]]

OURS = "as in Figure 3"


def changed(
    study: Study, system: str, choices: Choices = CHOICES
) -> dict[str, list[Trial]]:
    """The trials of a system with each of the choices changed: CHOICES on a small dataset, RELEASED at every size."""
    small, every = (
        study.preset.ablation_minutes[:1],
        study.preset.novice_minutes(system),
    )
    sizes = {words: small if words in CHOICES else every for words in choices}
    return {
        words: study.changed(**changes).points(system, methods, sizes[words])
        for words, (changes, methods) in choices.items()
    }


def trials(study: Study, system: str) -> list[Trial]:
    """Figure 3's methods on a small dataset with one of our choices changed at a time."""
    return sum(changed(study, system).values(), [])


def released(study: Study, system: str) -> list[Trial]:
    """Figure 3 with choices of the released code made together."""
    return sum(changed(study, system, RELEASED).values(), [])


def frame(
    study: Study, store: Results, systems: Iterable[str], choices: Choices = CHOICES
) -> pd.DataFrame:
    """Stored results by `choice`, those of Figure 3's own sizes and methods among them as OURS."""
    parts = []
    for system in systems:
        own = {OURS: study.points(system, FIGURE3, study.preset.novice_minutes(system))}
        for words, some in (own | changed(study, system, choices)).items():
            parts.append(store.frame(some).assign(choice=words))
    return pd.concat(parts)


def table(frame: pd.DataFrame) -> pd.DataFrame:
    """Losses with a choice changed beside OURS: `pairs.beside`, a ratio above 1 where ours is the better."""
    return beside(
        frame[frame.choice != OURS],
        frame[frame.choice == OURS],
        ["system", "method", "novice_minutes"],
        ["choice"],
    )
