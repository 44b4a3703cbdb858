"""The suspension under one's fingers: robots over the same ground, and what their springs do.

`rides` simulates and `views` draws; `live` has sliders that simulate anew, and `grid` and `page` make the book's page,
whose sliders choose among rides that were simulated before.
"""

from sidm.explorer.live import explorer, with_picture
from sidm.explorer.rides import ROBOTS, Ride, find_robot, ride, tilt
from sidm.explorer.views import rides_figure

__all__ = ["ROBOTS", "Ride", "explorer", "find_robot", "ride", "rides_figure", "tilt", "with_picture"]
