"""The suspension under one's fingers: robots over the same ground, what their springs do, and how they drive.

`rides` simulates and `views` draws charts; `live` has sliders that simulate anew, and `grid` and `page` make the book's
page, whose sliders choose among rides that were simulated before. `replay` shows rides in three dimensions: `scene` and
`predictions` say what moves, `skeleton` what a robot is made of, and the scripts in `static` draw it in a browser.
"""

from sidm.lazy import on_demand

__getattr__, __dir__, __all__ = on_demand(
    __name__,
    live="explorer with_picture",
    rides="ROBOTS Ride find_robot ride tilt weave",
    scene="Scene Track drives_scene rides_scene",
    scene_file="read_scene write_scene",
    viewer="View replay",
    views="rides_figure",
)
