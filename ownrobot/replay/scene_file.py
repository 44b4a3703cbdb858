"""Scenes as JSON for the browser, and as files.

The file of a scene is an .npz file with a checksum. It holds `scene`, a JSON text of
all that is no array; `heights` (H, W), m; and for each track N the arrays `position N`
(T + 1, 3), m, `quaternion N` (T + 1, 4) and `joints N` (T + 1, J), rad.
"""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np

from ownrobot.replay.packing import pack, text
from ownrobot.replay.scene import MARGIN, Scene, Track
from sidm.drives import Ground
from sidm.storage import Damaged, read_arrays, write_arrays

LARGEST = 220  # points on a side of the ground in a page; a larger one is thinned out
LARGEST_INTEGER = 32_000  # for positions, angles and heights, which are sent as int16
#: largest scales from a quantity to integers
PER_METRE, PER_QUATERNION, PER_RADIAN = 1000.0, 10_000.0, 2000.0
ARRAYS = ("position", "quaternion", "joints")  # fields of a track


def track_json(track: Track) -> dict[str, Any]:
    """JSON types of a track, for static/replay.js."""
    quaternion = np.asarray(track.quaternion, float)
    # q and -q are the same attitude: take the sign that makes the series continuous.
    flips = np.where((quaternion[1:] * quaternion[:-1]).sum(1) < 0, -1, 1)
    signs = np.concatenate([[1], np.cumprod(flips)])
    parts = [track.position, quaternion * signs[:, None], track.joints]
    columns = np.column_stack(parts)
    joints = track.joints.shape[1]
    finest = np.repeat([PER_METRE, PER_QUATERNION, PER_RADIAN], [3, 4, joints])
    largest = np.maximum(np.abs(columns).max(axis=0), 1e-9)
    scales = np.minimum(finest, LARGEST_INTEGER / largest).round(3)
    return {
        "name": track.name,
        "colour": track.colour,
        "ghost": track.ghost,
        "skeleton": track.skeleton,
        "step": track.step,
        "moments": len(columns),
        "scales": scales.tolist(),
        "motion": text(pack(np.rint(columns * scales).astype(np.int16))),
    }


def cropped(ground: Ground, points: np.ndarray, margin: float = MARGIN) -> Ground:
    """The ground around points (N, 2), m, and a margin, m.

    Of a large piece only every second, third, ... grid point is taken, so that there
    are at most LARGEST points on a side.
    """
    spacing, corner = ground.spacing, _corner(ground)
    low = np.floor((points.min(0) - margin - corner) / spacing).astype(int).clip(0)
    high = np.ceil((points.max(0) + margin - corner) / spacing).astype(int) + 1
    size = np.minimum(high, ground.heights.shape[::-1]) - low
    every = max(1, math.ceil(size.max() / LARGEST))
    heights = ground.heights[low[1] : high[1] : every, low[0] : high[0] : every]
    coarse = every * spacing
    half = coarse * (np.array(heights.shape[::-1]) - 1) / 2
    x, y = corner + low * spacing + half
    return Ground(heights, coarse, (float(x), float(y)))


def _corner(ground: Ground) -> np.ndarray:
    """(2,) m, x and y of the grid's first point."""
    columns_rows = np.array(ground.heights.shape[::-1])
    return np.array(ground.centre) - ground.spacing * (columns_rows - 1) / 2


def ground_json(ground: Ground) -> dict[str, Any]:
    """JSON types of ground, for static/replay.js."""
    heights = ground.heights
    highest = max(float(np.abs(heights).max()), 1e-9)
    scale = round(min(PER_METRE, LARGEST_INTEGER / highest), 3)
    left, low = _corner(ground)
    return {
        "rows": heights.shape[0],
        "columns": heights.shape[1],
        "spacing": round(ground.spacing, 6),
        "scale": scale,
        "left": round(float(left), 4),
        "low": round(float(low), 4),
        "motion": text(pack(np.rint(heights * scale).astype(np.int16)[..., None])),
    }


def _cropped_ground(scene: Scene) -> Ground:
    """The ground around all tracks of a scene."""
    points = [track.position[:, :2] for track in scene.tracks]
    return cropped(scene.ground, np.concatenate(points))


def scene_json(scene: Scene) -> dict[str, Any]:
    """JSON types of a scene, for `sidmReplay.scene` of static/replay.js."""
    content = {
        "ground": ground_json(_cropped_ground(scene)),
        "tracks": [track_json(track) for track in scene.tracks],
        "distance": scene.distance,
    }
    return content | ({"label": scene.label} if scene.label else {})


def write_scene(path: str | Path, scene: Scene) -> None:
    """Write a scene as one .npz file, which `ownrobot replay` shows."""
    ground = _cropped_ground(scene)
    arrays = {"heights": np.asarray(ground.heights, np.float32)}
    tracks = []
    for number, track in enumerate(scene.tracks):
        fields = track._asdict()
        for name in ARRAYS:
            arrays[f"{name} {number}"] = np.asarray(fields.pop(name), np.float32)
        tracks.append(fields)
    content = {
        "tracks": tracks,
        "spacing": ground.spacing,
        "centre": ground.centre,
        "distance": scene.distance,
        "label": scene.label,
    }
    write_arrays(Path(path), {"scene": np.array(json.dumps(content))} | arrays)


def read_scene(path: str | Path) -> Scene:
    """Read a scene that `write_scene` wrote; Damaged where the file holds none."""
    arrays = read_arrays(Path(path))
    if "scene" not in arrays:
        raise Damaged("it holds no scene")
    content = json.loads(str(arrays["scene"]))
    tracks = []
    for number, fields in enumerate(content["tracks"]):
        series: dict[str, Any] = {name: arrays[f"{name} {number}"] for name in ARRAYS}
        tracks.append(Track(**fields, **series))
    ground = Ground(arrays["heights"], content["spacing"], tuple(content["centre"]))
    return Scene(tuple(tracks), ground, content["distance"], content["label"])
