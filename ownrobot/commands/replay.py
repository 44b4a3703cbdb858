"""The command `ownrobot replay`."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ownrobot.command_line import AddCommand
from ownrobot.commands.options import add_reading_options, refuse_inputs
from sidm.config import ConfigError, DataError, no_such_file

if TYPE_CHECKING:
    from ownrobot.replay.scene import Scene

EXAMPLES = """\
  ownrobot replay drive.csv --body robot.yaml --html replay.html
  ownrobot replay drive.csv --model model --shape 0.5,0.4,0.1 --html predicted.html"""


def add_replay(add: AddCommand) -> None:
    """Add `ownrobot replay`."""
    text = "Make a page that shows a ride in three dimensions, with nothing to install."
    replay = add("replay", run_replay, text, EXAMPLES)
    text = "a scene (.json) of `ownrobot.replay.write_scene`, or recorded drives"
    replay.add_argument("ride", metavar="PATH", help=text)
    text = "where to write the page"
    replay.add_argument("--html", metavar="FILE", required=True, help=text)
    text = "what recorded drives are made of, YAML (the paper's robots')"
    replay.add_argument("--body", metavar="FILE", help=text)
    text = "a model of the robot, whose prediction from the start is shown, too"
    replay.add_argument("--model", metavar="DIR", help=text)
    add_reading_options(replay)
    text = "which of the drives, from 0 (%(default)s)"
    replay.add_argument("--drive", type=int, default=0, metavar="N", help=text)
    text = (
        "what a recorded robot looks like: rover, warthog, husky, or "
        "WHEELBASE,TRACK,RADIUS in m (rover for the paper's, else husky)"
    )
    replay.add_argument("--shape", metavar="NAME", help=text)
    replay.add_argument("--title", help="of the page (the file's name)")


def run_replay(arguments: argparse.Namespace) -> int:
    """Run `ownrobot replay`: it writes the page and prints where it is."""
    from ownrobot.replay.viewer import View

    refuse_inputs([arguments.html], [arguments.ride, arguments.body, arguments.model])
    path = Path(arguments.ride)
    is_scene = path.suffix == ".json"
    scene = _scene_of_file(path, arguments) if is_scene else _scene(path, arguments)
    View(scene, arguments.title or path.name).write(arguments.html)
    print(f"{arguments.html}: open it in a browser")
    return 0


def _scene_of_file(path: Path, arguments: argparse.Namespace) -> dict[str, Any]:
    """The JSON types in the file of a scene."""
    for name in ("body", "model", "drive", "shape", "topics", "skip_bad"):
        if getattr(arguments, name):
            option = name.replace("_", "-")
            raise ConfigError(
                f"{path} is a scene, and --{option} is of recorded drives; leave it out"
            )
    if not path.exists():
        raise DataError(no_such_file(path))
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        if {"ground", "tracks", "distance"} <= content.keys():
            return content
    except (OSError, ValueError, AttributeError):
        pass
    raise DataError(f"{path}: it holds no scene; ownrobot.replay.write_scene makes one")


def _scene(path: Path, arguments: argparse.Namespace) -> Scene:
    """The scene of one of the recorded drives in a file."""
    from ownrobot.body_file import read_body
    from ownrobot.fitting.arguments import drives_from
    from ownrobot.fitting.model import load
    from ownrobot.recordings import read_drives
    from ownrobot.replay.scene import drive_scene
    from ownrobot.replay.skeleton import find_box
    from sidm.body import ROVER
    from sidm.systems import SYSTEMS

    model = load(arguments.model) if arguments.model else None
    body = model.body if model else ROVER
    if arguments.body:
        body = read_body(arguments.body)
    shape = arguments.shape or ("rover" if body == ROVER else "husky")
    robot = SYSTEMS["system1"].novice if shape == "rover" else find_box(shape)
    reading = {"topics": arguments.topics, "skip_bad": arguments.skip_bad}
    drives = read_drives(path, body, allow_constant=True, **reading)
    if not 0 <= arguments.drive < len(drives):
        raise ConfigError(
            f"{path}: it has drives 0 to {len(drives) - 1}, not {arguments.drive}"
        )
    drive, predicted = drives[arguments.drive], None
    if model:
        [drive] = drives_from([drive], model.body, str(path))
        predicted = model.rollout(drive.states[0], drive.actions, ground=drive.ground)
    return drive_scene(drive, robot, predicted)
