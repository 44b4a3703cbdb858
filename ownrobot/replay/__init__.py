"""Motion in three dimensions: in a notebook, in an app, or as one self-contained page.

`scene` says what moves: simulated rides or recorded drives. `skeleton` says what a
robot is made of. The scripts in `static` draw both in a browser.
"""

from ownrobot.replay.rides import ROBOTS, Ride, find_robot, ride, tilt, weave
from ownrobot.replay.scene import Scene, Track, drive_scene, rides_scene
from ownrobot.replay.viewer import View, replay, write_scene

__all__ = [
    "ROBOTS",
    "Ride",
    "Scene",
    "Track",
    "View",
    "drive_scene",
    "find_robot",
    "replay",
    "ride",
    "rides_scene",
    "tilt",
    "weave",
    "write_scene",
]
