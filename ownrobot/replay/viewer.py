"""Scenes as a browser shows them: as JSON, in a notebook, as a self-contained page.

Series are compressed into few bytes. `unpack` here and `unpack` in static/replay.js do
the same; tests compare them.
"""

from __future__ import annotations

import base64
import functools
import html
import json
import math
import string
import zlib
from collections.abc import Mapping
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np

from ownrobot.replay.rides import Ride
from ownrobot.replay.scene import MARGIN, Scene, Track, rides_scene
from sidm.drives import Ground
from sidm.storage import write_atomically

#: in the order in which a page loads them
SCRIPTS = ("three.min.js", "robot.js", "ground.js", "replay.js")
STYLE = "replay.css"
HEIGHT = 640  # px, of the view in a notebook
LARGEST = 220  # points on a side of the ground in a page; a larger one is thinned out
LARGEST_INTEGER = 32_000  # for positions, angles and heights, which are sent as int16
#: largest scales from a quantity to integers
PER_METRE, PER_QUATERNION, PER_RADIAN = 1000.0, 10_000.0, 2000.0


def pack(numbers: np.ndarray) -> bytes:
    """Compress series (..., T, C) int16 with deflate, channel by channel.

    Motion changes steadily, so second differences along T are small. They are wrapped
    to 16 bits, and the sign is moved to the lowest bit (zigzag). The low bytes of all
    numbers come first, then the high bytes, which are mostly 0.
    """
    second = np.moveaxis(numbers, -1, 0).astype(np.int16)
    for _ in range(2):
        second = np.diff(second, axis=-1, prepend=np.int16(0))
    zigzag = ((second << 1) ^ (second >> 15)).astype("<u2")
    planes = np.stack([zigzag & 255, zigzag >> 8]).astype(np.uint8)
    return zlib.compress(planes.tobytes(), 9)


def unpack(content: bytes, shape: tuple[int, ...]) -> np.ndarray:
    """Series of this shape (..., T, C), int16, from the bytes that `pack` returned."""
    planes = np.frombuffer(zlib.decompress(content), np.uint8)
    low, high = planes.reshape(2, shape[-1], *shape[:-1]).astype(np.uint16)
    zigzag = low | high << 8
    numbers = ((zigzag >> 1) ^ -(zigzag & 1)).astype(np.int16)
    for _ in range(2):
        numbers = numbers.cumsum(axis=-1, dtype=np.int16)
    return np.moveaxis(numbers, 0, -1)


def text(content: bytes) -> str:
    """Bytes as base64 text, which a script can hold."""
    return base64.b64encode(content).decode()


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


def scene_json(scene: Scene) -> dict[str, Any]:
    """JSON types of a scene, for `sidmReplay.scene` of static/replay.js."""
    points = np.concatenate([track.position[:, :2] for track in scene.tracks])
    content = {
        "ground": ground_json(cropped(scene.ground, points)),
        "tracks": [track_json(track) for track in scene.tracks],
        "distance": scene.distance,
    }
    return content | ({"label": scene.label} if scene.label else {})


def _compact(content: Mapping[str, Any]) -> str:
    return json.dumps(content, separators=(",", ":"))


def write_scene(path: str | Path, scene: Scene) -> None:
    """Write the JSON of a scene as a file .json, which `ownrobot replay` shows."""
    content = _compact(scene_json(scene)).encode()
    write_atomically(Path(path), lambda file: file.write(content))


def static(name: str) -> str:
    """The text of a file in the folder `static`."""
    path = resources.files("ownrobot.replay") / "static" / name
    return path.read_text(encoding="utf-8")


@functools.cache
def _code() -> str:
    """All scripts, compressed, as text for a page."""
    return text(zlib.compress("\n".join(map(static, SCRIPTS)).encode(), 9))


class View:
    """A scene with a title, which notebooks show and `write` writes as a page.

    The scene may be the JSON types in its file, too.
    """

    def __init__(self, scene: Scene | Mapping[str, Any], title: str = "Replay") -> None:
        self.scene, self.title = scene, title

    def page(self, heading: bool = True) -> str:
        """One HTML page that needs no other file; `heading` shows the title in it."""
        title = html.escape(self.title)
        scene = self.scene
        content = scene_json(scene) if isinstance(scene, Scene) else scene
        return string.Template(static("page.html")).substitute(
            title=title,
            heading=f"<h1>{title}</h1>" if heading else "",
            style=static(STYLE),
            code=_code(),
            scene=_compact(content).replace("</", "<\\/"),
        )

    def write(self, path: str | Path) -> None:
        """Write the page."""
        content = self.page().encode()
        write_atomically(Path(path), lambda file: file.write(content))

    def _repr_html_(self) -> str:
        """The page in an iframe, which keeps the notebook's styles out."""
        page, title = html.escape(self.page(heading=False)), html.escape(self.title)
        look = f"border: 0; height: {HEIGHT}px; max-width: 60rem; width: 100%"
        return f'<iframe title="{title}" style="{look}" srcdoc="{page}"></iframe>'


def replay(rides: Ride | Mapping[str, Ride] | Scene, title: str = "Replay") -> View:
    """View a ride, several rides by name, the first one solid, or a scene."""
    return View(rides if isinstance(rides, Scene) else rides_scene(rides), title)
