"""The suspension under one's fingers: robots over the same ground, what their springs do, and how they drive.

`rides` simulates and `views` draws charts; `live` has sliders that simulate anew, and `grid` and `page` make the book's
page, whose sliders choose among rides that were simulated before. `replay` shows rides in three dimensions: `scene` and
`predictions` say what moves, `skeleton` what a robot is made of, and the scripts in `static` draw it in a browser.
"""

from typing import TYPE_CHECKING

from sidm.lazy import on_demand

if TYPE_CHECKING:
    from sidm.explorer.live import explorer, with_picture
    from sidm.explorer.rides import ROBOTS, Ride, find_robot, ride, tilt, weave
    from sidm.explorer.scene import Scene, Track, drives_scene, rides_scene
    from sidm.explorer.scene_file import read_scene, write_scene
    from sidm.explorer.viewer import View, replay
    from sidm.explorer.views import rides_figure

__all__ = [
    "ROBOTS", "Ride", "Scene", "Track", "View", "drives_scene", "explorer", "find_robot", "read_scene", "replay",
    "ride", "rides_figure", "rides_scene", "tilt", "weave", "with_picture", "write_scene",
]  # fmt: skip

on_demand(
    __name__,
    live="explorer with_picture",
    rides="ROBOTS Ride find_robot ride tilt weave",
    scene="Scene Track drives_scene rides_scene",
    scene_file="read_scene write_scene",
    viewer="View replay",
    views="rides_figure",
)
