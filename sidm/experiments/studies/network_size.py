"""Does what an SIDM saves grow with the networks? Maps to 64 pixels, LSTMs up to the paper's, one size of data."""

from __future__ import annotations

import pandas as pd

from sidm.experiments.methods import COMPARED, FIGURE3
from sidm.experiments.statistics.pairs import beside
from sidm.experiments.study import Study
from sidm.experiments.trials import Trial

MINUTES = (5.0,)
#: Pixels a side of the map, LSTM layers and hidden units -> trials; the paper has 300 pixels and the last LSTM.
SIZES = {(16, 3, 256): 3, (32, 1, 128): 3, (32, 3, 256): 3, (64, 3, 256): 3, (32, 4, 1024): 1}
LARGE = ((64, 3, 256), (32, 4, 1024))  # which take so long that the paper's two methods alone are trained


def trials(study: Study, system: str) -> list[Trial]:
    """Figure 3's methods with networks of each size, the paper's two with those that are LARGE."""
    found = []
    for size, seeds in SIZES.items():
        changed = study.changed(**dict(zip(("pixels", "layers", "hidden"), size, strict=True)))
        found += changed.points(system, COMPARED if size in LARGE else FIGURE3, MINUTES, seeds=seeds)
    return found


def table(frame: pd.DataFrame) -> pd.DataFrame:
    """All methods beside training without SIDM, by size of the networks: `pairs.beside`, below 1 where better."""
    alone = frame.method == COMPARED[1]
    size = ["system", "novice_minutes", "pixels", "layers", "hidden"]
    return beside(frame[~alone], frame[alone], on=size)
