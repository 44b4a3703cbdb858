"""Recorded motion of a robot of any body, read from files and ROS bags.

Every fault of a recording is named in one line. The paper's robots (`sidm.body.ROVER`)
have these columns, in any order and in the units that a file's header names:

==================  =================  ===============================================
columns             units              quantity
==================  =================  ===============================================
x, y, z             m, cm, mm          position of the chassis' centre of mass, world
qx, qy, qz, qw      1                  attitude, a unit quaternion, body to world
vx, vy, vz          m/s, cm/s, km/h    velocity, in the body frame: x forward, y left,
                                       z up
wx, wy, wz          rad/s, deg/s       angular velocity, in the body frame
throttle, steering  1                  action from this row to the next, each in
                                       [-1, 1]; positive is forward, and to the right
==================  =================  ===============================================

Their ground is a grid of heights in the same world, index [y, x], both growing, with
its spacing and the x and y of its middle. Any other robot has the columns of its own
body. `csv_file`, `npz_file` and `bags` describe the files; `checks` describes what is
refused.
"""

from __future__ import annotations

from ownrobot.recordings.guess import Guess, guess_body
from ownrobot.recordings.reading import read_drives, write_drives
from ownrobot.recordings.table import RecordingError, RecordingWarning
from sidm.drives import Drive, Ground

__all__ = [
    "Drive",
    "Ground",
    "Guess",
    "RecordingError",
    "RecordingWarning",
    "guess_body",
    "read_drives",
    "write_drives",
]
