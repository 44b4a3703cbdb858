"""Recorded motion of a robot from elsewhere: a table of numbers, a map of the ground, every fault named in one line.

A recording is a table with a row every so often. Its columns, in any order and in the units that its header names:

==========================  ===================  ======================================================
columns                     units                quantity
==========================  ===================  ======================================================
x, y, z                     m, cm, mm            position of the chassis' centre of mass, world
qx, qy, qz, qw              1                    attitude, a unit quaternion, body to world
vx, vy, vz                  m/s, cm/s, km/h      velocity, in the body frame: x forward, y left, z up
wx, wy, wz                  rad/s, deg/s         angular velocity, in the body frame
throttle, steering          1                    the action from this row to the next, each in [-1, 1]; positive
                                                 is forward, and to the right
time                        s, ms                may be there: then missing rows are noticed
==========================  ===================  ======================================================

The rate is a whole multiple of 10 Hz, that of the models: of more rows every so many-th is taken, with the mean action
up to the next. The ground is a grid of heights in the same world, index [y, x], both growing, with its spacing and the
x and y of its middle. Files are those of `csv_file` and `npz_file`.

What is refused: what is not finite, no unit quaternion, out of range or off the map; rows that are missing; positions
that jump; velocities that do not lead where the robot was a second later, as those of another frame or unit do not;
angular velocities that turn the robot much more or less than its attitudes say, or that would fit them better with
another sign, in another frame or in another order; a map that fits better upside down, the wrong way round or
transposed; and recordings that, taken together, turn against their steering as they drive forward. What fits all that
and is wrong all the same, such as a throttle's sign, cannot be seen.
"""

from __future__ import annotations

from pathlib import Path

from sidm.recordings.csv_file import has_header, read_csv, read_header
from sidm.recordings.frames import refuse_other_steering
from sidm.recordings.npz_file import read_npz, write_recordings
from sidm.recordings.recording import COLUMNS, Ground, Recording, RecordingError
from sidm.recordings.table import from_table

__all__ = ["COLUMNS", "Ground", "Recording", "RecordingError", "from_table", "read_recordings", "write_recordings"]


def read_recordings(path: str | Path) -> list[Recording]:
    """The recordings of a .npz or .csv file, or of all .csv files of a folder that are not the ground of another.

    Raises:
        RecordingError: there are none, or one of them has a fault; one line that names file, place and fault.
    """
    found = _read(Path(path))
    refuse_other_steering(str(path), found)
    return found


def _read(path: Path) -> list[Recording]:
    if path.is_dir():
        every = sorted(path.glob("*.csv"))
        files = [file for file in every if has_header(file)]
        if not files:
            raise RecordingError(f"{path}: no .csv file in this folder begins with a header of '# name: value' lines")
        grounds = {(path / read_header(file)["heights"]).resolve() for file in files}
        strange = [file for file in every if file not in files and file.resolve() not in grounds]
        if strange:
            raise RecordingError(f"{strange[0]}: neither a recording, for it has no header, nor the ground of one")
        return [read_csv(file) for file in files]
    if not path.is_file():
        raise RecordingError(f"{path}: there is no such file")
    if path.suffix == ".csv":
        return [read_csv(path)]
    if path.suffix == ".npz":
        return read_npz(path)
    raise RecordingError(f"{path}: recordings are .npz or .csv files, or a folder of .csv files")
