"""Rides in three dimensions: in a notebook, in the app, and as a page that needs nothing else."""

from __future__ import annotations

import functools
import html
import json
import string
import zlib
from collections.abc import Mapping
from importlib import resources
from pathlib import Path

from sidm.replay.packing import text
from sidm.replay.rides import Ride
from sidm.replay.scene import Scene, rides_scene
from sidm.replay.scene_file import scene_json
from sidm.storage import write_atomically

#: in the order in which they are read
SCRIPTS = ("three.min.js", "robot.js", "ground.js", "replay.js")
STYLE = "replay.css"
TALL = 640  # px, of the view in a notebook


def static(name: str) -> str:
    """The text of a file that pages are made of."""
    return (resources.files("sidm.replay") / "static" / name).read_text(
        encoding="utf-8"
    )


@functools.cache
def _code() -> str:
    return text(zlib.compress("\n".join(map(static, SCRIPTS)).encode(), 9))


class View:
    """A scene to look at. Notebooks show it; `write` makes a page of it."""

    def __init__(self, scene: Scene, title: str = "Replay") -> None:
        """`title` is the page's."""
        self.scene, self.title = scene, title

    def page(self, heading: bool = True) -> str:
        """One HTML page with everything in it."""
        title = html.escape(self.title)
        return string.Template(static("page.html")).substitute(
            title=title,
            heading=f"<h1>{title}</h1>" if heading else "",
            style=static(STYLE),
            code=_code(),
            scene=json.dumps(scene_json(self.scene), separators=(",", ":")).replace(
                "</", "<\\/"
            ),
        )

    def write(self, path: str | Path) -> None:
        """Write the page; OSError, one line, where that cannot be done."""
        content = self.page().encode()
        write_atomically(Path(path), lambda file: file.write(content))

    def _repr_html_(self) -> str:
        """The page in a frame of its own, so that nothing of the notebook's gets into its way."""
        page, title = html.escape(self.page(heading=False)), html.escape(self.title)
        look = f"border: 0; height: {TALL}px; max-width: 60rem; width: 100%"
        return f'<iframe title="{title}" style="{look}" srcdoc="{page}"></iframe>'


def replay(rides: Ride | Mapping[str, Ride] | Scene, title: str = "Replay") -> View:
    """A ride to look at from all sides, or several by their names, all but the first as ghosts; or any scene.

    Args:
        rides: over the same ground.
        title: of the page.
    """
    return View(rides if isinstance(rides, Scene) else rides_scene(rides), title)
