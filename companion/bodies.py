"""Other bodies of the paper's novices: other observations or actions, same motion."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from sidm.body import DRIVE, ROVER, TWIST, Body
from sidm.config import replace, unknown_name
from sidm.drives import QUATERNION, Drive

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
#: Bodies of novices by their names.
NOVICES: dict[str, Body] = {
    name: Body(name=name, **_ROVER | changes) for name, changes in _BODIES.items()
}


def seen_by(drives: Sequence[Drive], body: Body) -> list[Drive]:
    """Drives of the paper's robots as another body sees them.

    A column of `body` is a velocity of the paper's state or one of TILT, the up
    direction; an action is throttle, steering, or `left` and `right`, their sum and
    their difference. ConfigError names any other.
    """
    return [drive if body == ROVER else _seen_by(drive, body) for drive in drives]


def _seen_by(drive: Drive, body: Body) -> Drive:
    # here, since benchmark tasks are listed without PyTorch
    import torch

    from sidm import rotations

    states = torch.from_numpy(drive.states).double()
    quaternions = states[:, QUATERNION]
    up = rotations.rotate_inverse(quaternions, states.new_tensor([0.0, 0.0, 1.0]))
    known = dict(zip(dict(TWIST), states[:, QUATERNION.stop :].T, strict=True))
    known |= zip(dict(TILT), up.T, strict=True)
    throttle, steering = drive.actions.astype(float).T
    commands = {
        "throttle": throttle,
        "steering": steering,
        "left": throttle + steering,
        "right": throttle - steering,
    }
    poses = {
        "none": [],
        "planar": [*states[:, :2].T, rotations.yaw(quaternions)],
        "spatial": [*states[:, : QUATERNION.stop].T],
    }
    return replace(
        drive,
        states=np.stack([*poses[body.pose], *_chosen(body.columns, known, body)], -1),
        actions=np.stack(_chosen(body.actions, commands, body), -1),
        body=body,
        ground=drive.ground if body.map_size else None,
    )


def _chosen(wanted: Sequence[tuple[str, str]], known: dict[str, Any], body: Body):
    """The columns that are wanted, of those that are known by their names."""
    for name, _ in wanted:
        if name not in known:
            about = f"body '{body.name}' of the paper's robots"
            raise unknown_name(name, known, about)
    return [known[name] for name, _ in wanted]
