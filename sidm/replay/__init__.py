"""Motion to look at in three dimensions: in a notebook, in an app, and as a page that needs nothing else.

`scene` says what moves, a simulated ride or recorded drives; `skeleton` what a robot is
made of; the scripts in `static` draw it in a browser.
"""

from sidm.replay.rides import ROBOTS, Ride, find_robot, ride, tilt, weave
from sidm.replay.scene import Scene, Track, drives_scene, rides_scene
from sidm.replay.scene_file import read_scene, write_scene
from sidm.replay.viewer import View, replay

__all__ = [
    "ROBOTS",
    "Ride",
    "Scene",
    "Track",
    "View",
    "drives_scene",
    "find_robot",
    "read_scene",
    "replay",
    "ride",
    "rides_scene",
    "tilt",
    "weave",
    "write_scene",
]
