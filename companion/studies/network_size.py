"""Does the data that an SIDM saves grow with the networks?

Maps have up to 128 pixels on each side, LSTMs are as large as the paper's; the novice
dataset has one size.
"""

from __future__ import annotations

from typing import Any

import pandas as pd

from companion.methods import COMPARED, FIGURE3
from companion.statistics.pairs import paired_comparison
from companion.studies.tuning import TUNING_SEED
from companion.study import Study
from companion.trials import Trial

MINUTES = (5.0,)
PAPER_LSTM = (32, 4, 1024)
#: Pixels on each side of the map, LSTM layers, hidden units -> number of seeds. The
#: paper's maps have 300 pixels.
SIZES = {
    (16, 3, 256): 3,
    (32, 1, 128): 3,
    (32, 3, 256): 3,
    (64, 3, 256): 3,
    (128, 3, 256): 3,
    PAPER_LSTM: 1,
}
#: Sizes so slow that only the paper's two methods are trained.
LARGE = ((64, 3, 256), (128, 3, 256), PAPER_LSTM)

#: Learning rates tried for PAPER_LSTM, which hardly learns with Figure 3's rate and
#: patience; they are tried on motion that settings are chosen by.
RATES = (1e-3, 3e-4, 1e-4)
#: Training up to the cap on samples, meant for a GPU. Both methods have the SIDM's
#: number of matching iterations (Algorithm 2), so that one bundle has both.
LONG: dict[str, Any] = {
    "patience": 1_000_000,
    "precision": "tf32",
    "matching_iterations": 5,
}
#: Long training at the rate with both methods' lowest test loss, with a cap that lies
#: past the minimum of both.
SLOW: dict[str, Any] = LONG | {"learning_rate": 3e-4, "max_samples": 400_000}
#: Sizes trained with the settings SLOW -> number of seeds.
SLOW_SIZES = {(32, 3, 256): 3, PAPER_LSTM: 3}
SIZE = ("pixels", "layers", "hidden")


def trials(study: Study, system: str) -> list[Trial]:
    """Trials at each network size, and the tries of learning rates.

    Figure 3's methods are trained at each size; only the paper's two at the sizes that
    are LARGE, and with the smaller learning rate.
    """
    trials = []
    for size, seeds in SIZES.items():
        methods = COMPARED if size in LARGE else FIGURE3
        trials += resized(study, size).points(system, methods, MINUTES, seeds=seeds)
    for size, seeds in SLOW_SIZES.items():
        slow = resized(study, size, **SLOW)
        trials += slow.points(system, COMPARED, MINUTES, seeds=seeds)
    return trials + tries(study, system)


def resized(study: Study, size: tuple[int, ...], **changes: Any) -> Study:
    """The study with networks of another size, and with other changes of its preset."""
    return study.changed(**dict(zip(SIZE, size, strict=True)), **changes)


def tries(study: Study, system: str) -> list[Trial]:
    """The paper's two methods with its LSTM at each of RATES, to choose a rate.

    Their motion and their seed are those of the tuning, which no figure has.
    """
    tuning = resized(Study(study.preset.for_tuning()), PAPER_LSTM, **LONG)
    return [
        tuning.changed(learning_rate=rate).trial(
            system, method, MINUTES[0], TUNING_SEED
        )
        for rate in RATES
        for method in COMPARED
    ]


def table(frame: pd.DataFrame) -> pd.DataFrame:
    """Ratios of all methods' losses to those of training without SIDM, without tries.

    The table is made by `pairs.paired_comparison`, one row per method, network size and
    `learning_rate` of training from random weights; below 1 where the method is better.
    """
    frame = frame[frame.seed < TUNING_SEED]
    first_rate = frame.pretraining_learning_rate.fillna(frame.learning_rate)
    frame = frame.assign(learning_rate=first_rate)
    alone = frame.method == COMPARED[1]
    point = ["system", "novice_minutes", *SIZE, "learning_rate"]
    return paired_comparison(frame[~alone], frame[alone], on=point)


def learning_ratios(table: pd.DataFrame) -> pd.Series:
    """SIDM's ratios at the sizes that learn within the patience of Figure 3."""
    small = (table.pixels < 128) & (table.layers < 4)
    fast = table.learning_rate != SLOW["learning_rate"]
    return table.ratio[(table.method == "sidm") & fast & small]


def slow_ratio(table: pd.DataFrame, hidden: int) -> str:
    """SIDM's ratio at the smaller rate, with LSTMs of so many hidden units, as text."""
    slow = table.learning_rate == SLOW["learning_rate"]
    rows = table[(table.method == "sidm") & slow & (table.hidden == hidden)]
    if len(rows) != 1 or rows.seeds.iloc[0] < 2:
        return "not run"
    return "{:.2f} ({:.2f} to {:.2f})".format(*rows[["ratio", "low", "high"]].iloc[0])
