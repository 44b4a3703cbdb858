"""Views of scenes in three dimensions: in a notebook, or as a self-contained page."""

from __future__ import annotations

import functools
import html
import json
import string
import zlib
from collections.abc import Mapping
from importlib import resources
from pathlib import Path

from ownrobot.replay.packing import text
from ownrobot.replay.rides import Ride
from ownrobot.replay.scene import Scene, rides_scene
from ownrobot.replay.scene_file import scene_json
from sidm.storage import write_atomically

#: in the order in which a page loads them
SCRIPTS = ("three.min.js", "robot.js", "ground.js", "replay.js")
STYLE = "replay.css"
HEIGHT = 640  # px, of the view in a notebook


def static(name: str) -> str:
    """The text of a file in the folder `static`."""
    path = resources.files("ownrobot.replay") / "static" / name
    return path.read_text(encoding="utf-8")


@functools.cache
def _code() -> str:
    """All scripts, compressed, as text for a page."""
    return text(zlib.compress("\n".join(map(static, SCRIPTS)).encode(), 9))


class View:
    """A scene with a title, which notebooks show and `write` writes as a page."""

    def __init__(self, scene: Scene, title: str = "Replay") -> None:
        self.scene, self.title = scene, title

    def page(self, heading: bool = True) -> str:
        """One HTML page that needs no other file; `heading` shows the title in it."""
        title = html.escape(self.title)
        scene = json.dumps(scene_json(self.scene), separators=(",", ":"))
        return string.Template(static("page.html")).substitute(
            title=title,
            heading=f"<h1>{title}</h1>" if heading else "",
            style=static(STYLE),
            code=_code(),
            scene=scene.replace("</", "<\\/"),
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
