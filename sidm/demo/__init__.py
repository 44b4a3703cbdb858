"""A model of a real robot in half a minute, from drives that come with the package: `sidm demo`.

`warthog.csv.gz` is nine minutes of a Clearpath Warthog, from norlab-ulaval/DRIVE,
`calib_data/test_warthog`, commit e158a19, BSD-3-Clause (`LICENSE-DRIVE.txt`); Baril et
al. (2023), arXiv:2309.10718.
"""

from __future__ import annotations

from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from sidm.config import replace
from sidm.drives import Drive
from sidm.fitting.fit import fit
from sidm.fitting.model import Model
from sidm.fitting.windows import hold_out
from sidm.recordings.reading import read_drives
from sidm.replay.scene import predicted_scene
from sidm.replay.skeleton import BOXES
from sidm.replay.viewer import View

if TYPE_CHECKING:
    import pandas as pd

HELD_OUT = 0.25  # share of the steps that judge, in whole sessions


class Demo(NamedTuple):
    """What `run` has made."""

    model: Model
    learnt: int  # drives that the model has learnt from
    judged: int  # drives that it has not
    errors: pd.DataFrame  # on those that judge, as of `Model.evaluate`
    page: Path  # the replay


def bundled_drives() -> list[Drive]:
    """The drives that come with the package."""
    with resources.as_file(resources.files(__name__)) as folder:
        drives = read_drives(folder / "warthog.csv.gz", folder / "skid_steer.yaml")
    return [replace(drive, name=Path(drive.name).name) for drive in drives]


def run(folder: str | Path) -> Demo:
    """Fit a model by least squares, judge it by drives held out, and write model and replay into a folder.

    Raises:
        OSError: the folder cannot be written.
    """
    learning, judging = hold_out(bundled_drives(), HELD_OUT)
    model = fit(learning, method="least_squares", out=Path(folder) / "model")
    turning = max(
        judging, key=lambda drive: float(abs(drive.states[-1, 2] - drive.states[0, 2]))
    )
    path = model.rollout(turning.states[0], turning.actions)
    page = Path(folder) / "replay.html"
    View(
        predicted_scene(turning, path, BOXES["warthog"]), "A Warthog and its model"
    ).write(page)
    return Demo(model, len(learning), len(judging), model.evaluate(judging), page)
