"""Pairs of robots that see or act differently: what an SIDM saves where weights cannot be copied.

The expert is system 1's as the paper has it; the novice, the same robot in the same motion, has another body.
"""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

from sidm.body import DRIVE, ROVER, TWIST, Body
from sidm.experiments.methods import ANY_BODIES
from sidm.experiments.statistics.pairs import beside
from sidm.experiments.study import Study
from sidm.experiments.trials import Trial

if TYPE_CHECKING:
    import pandas as pd

TILT = (("up_x", "1"), ("up_y", "1"), ("up_z", "1"))

#: What the novice is like -> its body.
NOVICES: dict[str, Body] = {
    body.name: body
    for body in (
        Body(name="no map", tilt=True, columns=TWIST, actions=DRIVE),
        Body(name="small map", tilt=True, columns=TWIST, actions=DRIVE, map_size=3.0, map_pixels=16),
        Body(name="no linear velocity", tilt=True, columns=TWIST[3:], actions=DRIVE, map_size=ROVER.map_size),
        Body(
            name="left and right", tilt=True, columns=TWIST, actions=(("left", "1"), ("right", "1")),
            map_size=ROVER.map_size,
        ),
        Body(name="planar", pose="planar", columns=(*TILT, *TWIST), actions=DRIVE, map_size=ROVER.map_size),
    )
}  # fmt: skip


def trials(study: Study, system: str) -> list[Trial]:
    """All methods that a pair of different bodies can be learnt by, on each novice."""
    found = []
    for body in NOVICES.values():
        network = dataclasses.replace(study.preset.network, novice_body=body)  # type: ignore[type-var]
        own = study.of(dataclasses.replace(study.preset, network=network))  # type: ignore[type-var]
        found += own.points(system, ANY_BODIES, study.preset.other_body_minutes, seeds=study.preset.seeds)
    return found


def table(frame: pd.DataFrame) -> pd.DataFrame:
    """SIDM beside training without it and beside the pretrained core: `pairs.beside`, below 1 where SIDM is better."""
    import pandas as pd

    point = ["system", "novice_body", "novice_minutes"]
    sidm = frame[frame.method == "sidm"]
    others = [name for name in ANY_BODIES if name != "sidm"]
    found = [beside(sidm, frame[frame.method == other], on=point).assign(against=other) for other in others]
    return pd.concat(found, ignore_index=True)
