"""What each figure cost on the machines that ran its trials."""

from __future__ import annotations

from typing import NamedTuple

from sidm.experiments.grids import FIGURES, grid
from sidm.experiments.store import Results
from sidm.experiments.study import Study


class FigureCost(NamedTuple):
    """One figure's stored trials."""

    figure: str  # a name of FIGURES
    trials: int
    stored: int
    hours: float  # of one processor or GPU, all together, the pretraining in the trials that did it
    peak_memory: float  # MiB, of the trial that needed most; 0 without any
    devices: tuple[str, ...]
    resumed: int  # trials that were interrupted, of which only the last stretch is counted


def figure_costs(study: Study, store: Results) -> list[FigureCost]:
    """A line a figure of a study; a trial that serves several figures counts in each of them."""
    table = []
    for figure in FIGURES:
        trials = grid(study.preset, figure, data=study.data, results=study.results)
        made = [row.provenance for row in store.rows(trials)]
        hours, most = sum(one.seconds for one in made) / 3600, max((one.peak_memory for one in made), default=0.0)
        devices = tuple(sorted({one.device for one in made}))
        resumed = sum(one.resumed for one in made)
        table.append(FigureCost(figure, len(trials), len(made), hours, most, devices, resumed))
    return table
