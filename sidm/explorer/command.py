"""The command `sidm replay`: a ride, or recorded drives, as one page to look at."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from sidm.fitting.command import Adds


def add_replay(command: Adds) -> None:
    """Add it to a command line."""
    made = command("replay", run_replay, "Make a page that shows a ride in three dimensions, with nothing to install.")
    made.add_argument("ride", metavar="PATH", help="a scene that was written by sidm.explorer, or recorded drives")
    made.add_argument("--html", metavar="FILE", required=True, help="where to write the page")
    made.add_argument("--body", metavar="FILE", help="what recorded drives are made of, YAML (the paper's robots')")
    made.add_argument("--drive", type=int, default=0, metavar="N", help="which of the drives, from 0 (%(default)s)")
    words = "what a recorded robot looks like: rover, warthog, husky, or WHEELBASE,TRACK,RADIUS in m"
    made.add_argument("--shape", metavar="NAME", help=f"{words} (rover for the paper's, else husky)")
    made.add_argument("--title", help="of the page (the file's name)")


def run_replay(arguments: argparse.Namespace) -> int:
    """`replay`: prints where the page is."""
    from sidm.explorer.viewer import View

    path = Path(arguments.ride)
    View(_scene(path, arguments), arguments.title or path.name).write(arguments.html)
    print(f"{arguments.html}: open it in a browser")
    return 0


def _scene(path: Path, arguments: argparse.Namespace) -> Any:
    from sidm.body import ROVER, read_body
    from sidm.config import ConfigError
    from sidm.explorer.scene import drives_scene
    from sidm.explorer.scene_file import read_scene
    from sidm.explorer.skeleton import find_box
    from sidm.recordings import read_drives
    from sidm.storage import Damaged
    from sidm.systems import SYSTEMS

    if path.suffix == ".npz" and not arguments.body:
        try:
            return read_scene(path)
        except Damaged:
            pass  # recorded drives, then, which says what else is wrong
    body = read_body(arguments.body) if arguments.body else ROVER
    shape = arguments.shape or ("husky" if arguments.body else "rover")
    like = SYSTEMS["system1"].novice if shape == "rover" else find_box(shape)
    drives = read_drives(path, body)
    if not 0 <= arguments.drive < len(drives):
        raise ConfigError(f"{path}: it has drives 0 to {len(drives) - 1}, not {arguments.drive}")
    return drives_scene([drives[arguments.drive]], body, like)
