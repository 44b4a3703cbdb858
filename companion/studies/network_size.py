"""Does what an SIDM saves grow with the networks? Maps up to 128 pixels, LSTMs up to the paper's, one size of data."""

from __future__ import annotations

from typing import Any

import pandas as pd

from companion.methods import COMPARED, FIGURE3
from companion.statistics.pairs import beside
from companion.studies.tuning import TUNING_SEED
from companion.study import Study
from companion.trials import Trial

MINUTES = (5.0,)
PAPER_LSTM = (32, 4, 1024)
#: Pixels a side of the map, LSTM layers and hidden units -> seeds; the paper's maps
#: have 300 pixels.
SIZES = {
    (16, 3, 256): 3,
    (32, 1, 128): 3,
    (32, 3, 256): 3,
    (64, 3, 256): 3,
    (128, 3, 256): 3,
    PAPER_LSTM: 1,
}
#: so slow that the paper's two methods alone are trained
LARGE = ((64, 3, 256), (128, 3, 256), PAPER_LSTM)

#: At Figure 3's rate and patience PAPER_LSTM hardly learns. These were tried, on motion
#: that settings are chosen by.
RATES = (1e-3, 3e-4, 1e-4)
#: To the cap, meant for a GPU; both methods with the SIDM's own iterations of Algorithm
#: 2, so that one bundle has both.
LONG: dict[str, Any] = {
    "patience": 1_000_000,
    "precision": "tf32",
    "matching_iterations": 5,
}
#: The rate of both methods' lowest test loss, a cap past both losses there, and the
#: sizes that are trained so.
SLOW: dict[str, Any] = LONG | {"learning_rate": 3e-4, "max_samples": 400_000}
SLOW_SIZES = {(32, 3, 256): 3, PAPER_LSTM: 3}
SIZE = ("pixels", "layers", "hidden")


def trials(study: Study, system: str) -> list[Trial]:
    """Figure 3's methods at each size, the paper's two at those that are LARGE or at the smaller rate; the tries."""
    found = []
    for size, seeds in SIZES.items():
        changed = sized(study, size)
        found += changed.points(
            system, COMPARED if size in LARGE else FIGURE3, MINUTES, seeds=seeds
        )
    for size, seeds in SLOW_SIZES.items():
        found += sized(study, size, **SLOW).points(
            system, COMPARED, MINUTES, seeds=seeds
        )
    return found + tries(study, system)


def sized(study: Study, size: tuple[int, ...], **changes: Any) -> Study:
    """The study with networks of a size, and with other changes of its preset."""
    return study.changed(**dict(zip(SIZE, size, strict=True)), **changes)


def tries(study: Study, system: str) -> list[Trial]:
    """The paper's two methods with its LSTM at each of RATES, on motion and a seed that no figure has."""
    chosen = sized(study.of(study.preset.for_tuning()), PAPER_LSTM, **LONG)
    return [
        chosen.changed(learning_rate=rate).trial(
            system, method, MINUTES[0], TUNING_SEED
        )
        for rate in RATES
        for method in COMPARED
    ]


def table(frame: pd.DataFrame) -> pd.DataFrame:
    """All methods beside training without SIDM: `pairs.beside`, below 1 where better, without the tries.

    Lines are told apart by the sizes of the networks and by the learning rate of
    training from scratch.
    """
    frame = frame[frame.seed < TUNING_SEED]
    frame = frame.assign(
        learning_rate=frame.pretraining_learning_rate.fillna(frame.learning_rate)
    )
    alone = frame.method == COMPARED[1]
    return beside(
        frame[~alone],
        frame[alone],
        on=["system", "novice_minutes", *SIZE, "learning_rate"],
    )
