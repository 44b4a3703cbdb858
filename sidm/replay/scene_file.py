"""Scenes as JSON for the browser, and as files.

A scene's file is a sealed .npz: `scene`, a JSON text of all that is no array; `heights`
(H, W), m; and of track N the arrays `position N` (T + 1, 3), `quaternion N` (T + 1, 4)
and `joints N` (T + 1, J).
"""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np

from sidm.drives import Ground
from sidm.replay.packing import pack, text
from sidm.replay.scene import MARGIN, Scene, Track
from sidm.storage import Damaged, read_arrays, write_arrays

LARGEST = 220  # points a side of the ground that is sent; a larger piece is thinned out
FINEST = 2000.0  # whole numbers to a radian, at most


def track_json(track: Track) -> dict[str, Any]:
    """A track as static/replay.js takes it."""
    turn = np.asarray(track.quaternion, float)
    flips = np.cumprod(np.where((turn[1:] * turn[:-1]).sum(1) < 0, -1, 1))
    turn = turn * np.concatenate([[1], flips])[:, None]
    columns = np.column_stack([track.position, turn, track.joints])
    largest = np.abs(columns).max(axis=0)
    finest = np.array([1000.0] * 3 + [10_000.0] * 4 + [FINEST] * track.joints.shape[1])
    scales = np.minimum(finest, 32_000 / np.maximum(largest, 1e-9)).round(3)
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


def cropped(ground: Ground, places: np.ndarray, margin: float = MARGIN) -> Ground:
    """The ground around places (N, 2), m, thinned out where there is much of it."""
    rows, columns = ground.heights.shape
    corner = (
        np.array(ground.centre) - ground.spacing * (np.array([columns, rows]) - 1) / 2
    )
    low = (
        np.floor((places.min(0) - margin - corner) / ground.spacing).astype(int).clip(0)
    )
    high = np.ceil((places.max(0) + margin - corner) / ground.spacing).astype(int) + 1
    thin = max(1, math.ceil((np.minimum(high, [columns, rows]) - low).max() / LARGEST))
    piece, spacing = (
        ground.heights[low[1] : high[1] : thin, low[0] : high[0] : thin],
        thin * ground.spacing,
    )
    x, y = (
        corner + low * ground.spacing + spacing * (np.array(piece.shape[::-1]) - 1) / 2
    )
    return Ground(piece, spacing, (float(x), float(y)))


def ground_json(ground: Ground) -> dict[str, Any]:
    """Ground as static/replay.js takes it."""
    heights, spacing = ground.heights, ground.spacing
    scale = round(min(1000.0, 32_000 / max(float(np.abs(heights).max()), 1e-9)), 3)
    left, low = (
        np.array(ground.centre) - spacing * (np.array(heights.shape[::-1]) - 1) / 2
    )
    return {
        "rows": heights.shape[0],
        "columns": heights.shape[1],
        "spacing": round(spacing, 6),
        "scale": scale,
        "left": round(float(left), 4),
        "low": round(float(low), 4),
        "motion": text(pack(np.rint(heights * scale).astype(np.int16)[..., None])),
    }


def _places(scene: Scene) -> np.ndarray:
    return np.concatenate([track.position[:, :2] for track in scene.tracks])


def scene_json(scene: Scene) -> dict[str, Any]:
    """A scene as `sidmReplay.scene` of static/replay.js takes it."""
    ground = ground_json(cropped(scene.ground, _places(scene)))
    found = {"ground": ground, "tracks": [track_json(track) for track in scene.tracks]}
    return (
        found
        | {"distance": scene.distance}
        | ({"label": scene.label} if scene.label else {})
    )


def write_scene(path: str | Path, scene: Scene) -> None:
    """Write a scene as one sealed .npz file, which `sidm replay` shows; OSError where that cannot be done."""
    ground = cropped(scene.ground, _places(scene))
    words = {
        "tracks": [
            {
                name: getattr(one, name)
                for name in ("name", "step", "skeleton", "colour", "ghost")
            }
            for one in scene.tracks
        ],
        "spacing": ground.spacing,
        "centre": list(ground.centre),
        "distance": scene.distance,
        "label": scene.label,
    }
    arrays = {
        "scene": np.array(json.dumps(words)),
        "heights": np.asarray(ground.heights, np.float32),
    }
    for number, one in enumerate(scene.tracks):
        for name in ("position", "quaternion", "joints"):
            arrays[f"{name} {number}"] = np.asarray(getattr(one, name), np.float32)
    write_arrays(Path(path), arrays)


def read_scene(path: str | Path) -> Scene:
    """What `write_scene` wrote.

    Raises:
        FileNotFoundError: there is no such file.
        Damaged: it is not as it was written, or no scene.
    """
    arrays = read_arrays(Path(path))
    if "scene" not in arrays:
        raise Damaged("it holds no scene")
    words = json.loads(str(arrays["scene"]))
    tracks = [
        Track(
            **(
                one
                | {
                    name: arrays[f"{name} {number}"]
                    for name in ("position", "quaternion", "joints")
                }
            )
        )
        for number, one in enumerate(words["tracks"])
    ]
    ground = Ground(arrays["heights"], words["spacing"], tuple(words["centre"]))
    return Scene(tuple(tracks), ground, words["distance"], words["label"])
