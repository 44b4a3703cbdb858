"""Other bodies of the paper's novices: other observations or actions, same motion."""

from __future__ import annotations

from typing import Any

from sidm.body import DRIVE, ROVER, TWIST, Body

TILT = (("up_x", "1"), ("up_y", "1"), ("up_z", "1"))
#: The body of the paper's robots, and what each novice's body has instead.
_ROVER: dict[str, Any] = {
    "tilt": True,
    "columns": TWIST,
    "actions": DRIVE,
    "map_size": ROVER.map_size,
}
_BODIES: dict[str, dict[str, Any]] = {
    "no map": {"map_size": 0.0},
    "small map": {"map_size": 3.0, "map_pixels": 16},
    "no linear velocity": {"columns": TWIST[3:]},
    "left and right": {"actions": (("left", "1"), ("right", "1"))},
    "planar": {"pose": "planar", "tilt": False, "columns": (*TILT, *TWIST)},
}
#: Name of the novice's body -> the body.
NOVICES: dict[str, Body] = {
    name: Body(name=name, **_ROVER | changes) for name, changes in _BODIES.items()
}
