"""Pairs of robots that see or act differently: what an SIDM saves where weights cannot be copied.

The expert is system 1's as the paper has it; the novice, the same robot in the same
motion, has another body.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from companion.figures.style import METHOD_STYLES, legend_below
from companion.methods import ANY_BODIES
from companion.statistics.pairs import beside
from companion.study import Study
from companion.trials import Trial
from sidm.body import DRIVE, ROVER, TWIST, Body
from sidm.plots import finish, side_by_side, styled

TILT = (("up_x", "1"), ("up_y", "1"), ("up_z", "1"))

#: What the novice is like -> its body.
NOVICES: dict[str, Body] = {
    body.name: body
    for body in (
        Body(name="no map", tilt=True, columns=TWIST, actions=DRIVE),
        Body(
            name="small map",
            tilt=True,
            columns=TWIST,
            actions=DRIVE,
            map_size=3.0,
            map_pixels=16,
        ),
        Body(
            name="no linear velocity",
            tilt=True,
            columns=TWIST[3:],
            actions=DRIVE,
            map_size=ROVER.map_size,
        ),
        Body(
            name="left and right",
            tilt=True,
            columns=TWIST,
            actions=(("left", "1"), ("right", "1")),
            map_size=ROVER.map_size,
        ),
        Body(
            name="planar",
            pose="planar",
            columns=(*TILT, *TWIST),
            actions=DRIVE,
            map_size=ROVER.map_size,
        ),
    )
}


def trials(study: Study, system: str) -> list[Trial]:
    """All methods that a pair of different bodies can be learnt by, on each novice."""
    found = []
    for body in NOVICES.values():
        network = dataclasses.replace(study.preset.network, novice_body=body)  # type: ignore[type-var]
        own = study.of(dataclasses.replace(study.preset, network=network))  # type: ignore[type-var]
        found += own.points(
            system,
            ANY_BODIES,
            study.preset.other_body_minutes,
            seeds=study.preset.seeds,
        )
    return found


def table(frame: pd.DataFrame) -> pd.DataFrame:
    """SIDM beside training without it and beside the pretrained core: `pairs.beside`, below 1 where SIDM is better."""
    point = ["system", "novice_body", "novice_minutes"]
    sidm = frame[frame.method == "sidm"]
    others = [name for name in ANY_BODIES if name != "sidm"]
    found = [
        beside(sidm, frame[frame.method == other], on=point).assign(against=other)
        for other in others
    ]
    return pd.concat(found, ignore_index=True)


def by_novice(frame: pd.DataFrame) -> pd.DataFrame:
    """Results of the novice as it is told apart by its body, a system each."""
    return frame.assign(system=frame.novice_body)


SHOWN = ("novice_only", "core_finetune")  # that an SIDM is drawn against


@styled
def figure(table: pd.DataFrame) -> Figure:
    """The loss with an SIDM by that of SHOWN, below 1 where the SIDM is better: a plot a size, a line a novice."""
    sizes = sorted(table.novice_minutes.unique())
    figure, panels = side_by_side(max(len(sizes), 1))
    names = list(NOVICES)
    for axes, minutes in zip(panels, sizes, strict=False):
        for number, other in enumerate(SHOWN):
            mine = table[(table.novice_minutes == minutes) & (table.against == other)]
            height = mine.novice_body.map(names.index) + 0.2 * (number - 0.5)
            off = np.clip([mine.ratio - mine.low, mine.high - mine.ratio], 0, None)
            style = METHOD_STYLES[other] | {
                "linestyle": "",
                "label": f"other: {METHOD_STYLES[other]['label']}",
            }
            axes.errorbar(
                mine.ratio, height, xerr=off, capsize=2, elinewidth=1, **style
            )
        axes.axvline(1, color="0.5", lw=1, linestyle="-", marker="", zorder=0)
        axes.set(
            xlabel="loss with SIDM / loss of the other (-)",
            title=f"{minutes:g} min of novice data",
        )
        axes.set_yticks(range(len(names)), names)
        axes.set_ylim(len(names) - 0.5, -0.5)
        finish(axes, legend=False)
    legend_below(figure, panels)
    return figure
