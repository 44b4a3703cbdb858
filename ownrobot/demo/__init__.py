"""The demonstration `ownrobot demo`: a model of a real robot in half a minute.

It learns from drives that come with the package. `warthog.csv.gz` has nine minutes of
motion of a Clearpath Warthog, from norlab-ulaval/DRIVE, `calib_data/test_warthog`,
commit e158a19, BSD-3-Clause (`LICENSE-DRIVE.txt`); Baril et al. (2023),
arXiv:2309.10718.
"""

from __future__ import annotations

import warnings
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from ownrobot.fitting.fit import fit
from ownrobot.fitting.model import Model
from ownrobot.fitting.splits import split
from ownrobot.recordings.reading import read_drives
from ownrobot.replay.scene import predicted_scene
from ownrobot.replay.skeleton import BOXES
from ownrobot.replay.viewer import View
from sidm.config import Notice, replace
from sidm.drives import Drive

if TYPE_CHECKING:
    import pandas as pd

HELD_OUT = 0.25  # share of the sessions, which evaluate the model


class Demo(NamedTuple):
    """The results of `run`.

    Attributes:
        model: the fitted model
        training_drives: how many drives the model was fitted to
        held_out_drives: how many drives it was evaluated on
        errors: its errors on the drives held out, as `Model.evaluate` returns them
        page: the file of the replay
    """

    model: Model
    training_drives: int
    held_out_drives: int
    errors: pd.DataFrame
    page: Path


def bundled_drives() -> list[Drive]:
    """The drives that come with the package."""
    with (
        resources.as_file(resources.files(__name__)) as folder,
        warnings.catch_warnings(),
    ):
        # Two of the drives are off their yaw; the demonstration keeps them.
        warnings.simplefilter("ignore", Notice)
        drives = read_drives(folder / "warthog.csv.gz", folder / "skid_steer.yaml")
    return [
        replace(drive, name=drive.name.removeprefix(f"{folder}/")) for drive in drives
    ]


def run(folder: str | Path) -> Demo:
    """Fit a model by least squares and evaluate it on drives held out.

    The folder gets the model and a replay.
    """
    training, held_out = split(bundled_drives(), HELD_OUT, seed=0)
    model = fit(training, method="least_squares", out=Path(folder) / "model")
    drive = max(held_out, key=_turned)
    path = model.rollout(drive.states[0], drive.actions)
    page = Path(folder) / "replay.html"
    scene = predicted_scene(drive, path, BOXES["warthog"])
    View(scene, "A Warthog and its model").write(page)
    return Demo(model, len(training), len(held_out), model.evaluate(held_out), page)


def _turned(drive: Drive) -> float:
    """Angle, rad, between the headings at the start and at the end of a drive."""
    return float(abs(drive.states[-1, 2] - drive.states[0, 2]))
