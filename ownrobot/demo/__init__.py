"""Drives of a real robot that come with the package, for `ownrobot demo`.

`warthog.csv.gz` has nine minutes of motion of a Clearpath Warthog, from
norlab-ulaval/DRIVE, `calib_data/test_warthog`, commit e158a19, BSD-3-Clause
(`LICENSE-DRIVE.txt`); Baril et al. (2023), arXiv:2309.10718.
"""

from __future__ import annotations

import warnings
from importlib import resources

from ownrobot.recordings.reading import read_drives
from sidm.config import Notice, replace
from sidm.drives import Drive


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
