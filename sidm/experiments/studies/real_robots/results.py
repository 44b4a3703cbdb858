"""What was found of real robots: losses and open-loop errors by size of data, beside each other seed by seed."""

from __future__ import annotations

from typing import TYPE_CHECKING

from sidm.experiments.figures.style import METHOD_STYLES, finish, side_by_side, styled
from sidm.experiments.statistics.pairs import beside
from sidm.experiments.studies.real_robots.measure import ALONE, PAIRS

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

SIZED = ("minutes", "loss", "displacement", "heading", "cold_displacement", "cold_heading")
NAMES = {"differential_drive": "ideal differential drive", "rotation_centres": "instantaneous centres of rotation"}


def long(frame: pd.DataFrame) -> pd.DataFrame:
    """Records as a line a pair, method, seed and size; errors open loop are those after 1.5 s.

    What needs no expert stands in every pair of its novice.
    """
    found = frame.explode(["sessions", *SIZED]).assign(novice_minutes=lambda one: one.sessions.astype(float))
    for name in SIZED[2:]:
        found[name] = found[name].str[-1]
    found = found.astype(dict.fromkeys(SIZED, float))
    pairs = []
    for pair, (expert, novice) in PAIRS.items():
        alone = (found.novice == novice) & found.method.isin(ALONE) & (found.expert == "")
        mine = found[alone | ((found.novice == novice) & (found.expert == expert))]
        pairs.append(mine.assign(system=pair))
    import pandas as pd

    return pd.concat(pairs, ignore_index=True)


def table(frame: pd.DataFrame, value: str = "loss", against: str = "novice_only") -> pd.DataFrame:
    """Every method beside another, seed by seed: `pairs.beside`, below 1 where it predicts better.

    Args:
        frame: of records.
        value: 'loss', or an error open loop after 1.5 s.
        against: the method that the others are held against.
    """
    every = long(frame)
    found = beside(every[every.method != against], every[every.method == against], value=value)
    return found.rename(columns={"novice_minutes": "sessions"})


@styled
def figure(frame: pd.DataFrame, value: str = "loss", label: str = "loss, 1 a component is the mean's") -> Figure:
    """Means over seeds against minutes of the novice's motion: a plot a pair, a line a method."""
    every = long(frame)
    figure, panels = side_by_side(len(PAIRS))
    for axes, pair in zip(panels, PAIRS, strict=True):
        mine = every[every.system == pair]
        for method, some in mine.groupby("method", sort=False):
            means = some.groupby("sessions")[["minutes", value]].mean()
            style = METHOD_STYLES.get(method, {"label": NAMES.get(method, method)})
            axes.plot(means.minutes, means[value], **style)
        axes.set(xscale="log", yscale="log", xlabel="novice data (min)", ylabel=label, title=pair)
        finish(axes)
    return figure
