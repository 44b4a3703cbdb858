"""Does what an SIDM saves grow with the size of the networks? Maps and LSTMs up to the paper's, at one size of data."""

from __future__ import annotations

import pandas as pd

from sidm.experiments.methods import COMPARED, FIGURE3
from sidm.experiments.statistics.pairs import beside
from sidm.experiments.study import Study
from sidm.experiments.trials import Trial

MINUTES, SEEDS = (5.0,), 3
PIXELS = (16, 32, 64, 128)  # with the LSTM of 3 x 256; the paper's 300 take a GPU
LSTMS = ((1, 128), (3, 256), (4, 1024))  # layers and hidden units, with maps of 32 pixels; the last is the paper's


def trials(study: Study, system: str) -> list[Trial]:
    """Figure 3's methods with networks of each size, each once."""
    sizes = [(pixels, 3, 256) for pixels in PIXELS] + [(32, layers, hidden) for layers, hidden in LSTMS]
    found: dict[str, Trial] = {}
    for pixels, layers, hidden in sizes:
        changed = study.changed(pixels=pixels, layers=layers, hidden=hidden)
        found |= {trial.key: trial for trial in changed.points(system, FIGURE3, MINUTES, seeds=SEEDS)}
    return list(found.values())


def table(frame: pd.DataFrame) -> pd.DataFrame:
    """All methods beside training without SIDM, by size of the networks: `pairs.beside`, below 1 where better."""
    alone = frame.method == COMPARED[1]
    size = ["system", "novice_minutes", "pixels", "layers", "hidden"]
    return beside(frame[~alone], frame[alone], on=size)
