"""The command `ownrobot replay`."""

from __future__ import annotations

import argparse
import contextlib
from pathlib import Path
from typing import Any

from ownrobot.command_line import AddCommand
from ownrobot.commands.options import refuse_inputs
from sidm.config import ConfigError

EXAMPLES = """\
  ownrobot replay drive.csv --body robot.yaml --html replay.html
  ownrobot replay drive.csv --model model --shape 0.5,0.4,0.1 --html predicted.html"""


def add_replay(add: AddCommand) -> None:
    """Add `ownrobot replay`."""
    text = "Make a page that shows a ride in three dimensions, with nothing to install."
    replay = add("replay", run_replay, text, EXAMPLES)
    text = "a scene that `ownrobot.replay.write_scene` wrote, or recorded drives"
    replay.add_argument("ride", metavar="PATH", help=text)
    text = "where to write the page"
    replay.add_argument("--html", metavar="FILE", required=True, help=text)
    text = "what recorded drives are made of, YAML (the paper's robots')"
    replay.add_argument("--body", metavar="FILE", help=text)
    text = "a model of the robot, whose prediction from the start is shown, too"
    replay.add_argument("--model", metavar="DIR", help=text)
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

    refuse_inputs([arguments.html], [arguments.ride, arguments.body])
    title = arguments.title or Path(arguments.ride).name
    View(_scene(arguments), title).write(arguments.html)
    print(f"{arguments.html}: open it in a browser")
    return 0


def _scene(arguments: argparse.Namespace) -> Any:
    """The scene in a file, or the scene of one of the recorded drives in it."""
    from ownrobot.body_file import read_body
    from ownrobot.fitting.model import load
    from ownrobot.recordings import read_drives
    from ownrobot.replay.scene import drives_scene, predicted_scene
    from ownrobot.replay.scene_file import read_scene
    from ownrobot.replay.skeleton import find_box
    from sidm.body import ROVER
    from sidm.storage import Damaged
    from sidm.systems import SYSTEMS

    path = Path(arguments.ride)
    model = load(arguments.model) if arguments.model else None
    if path.suffix == ".npz" and not (arguments.body or model):
        # the file may hold recorded drives; reading them finds other faults
        with contextlib.suppress(Damaged):
            scene = read_scene(path)
            if arguments.shape or arguments.drive:
                raise ConfigError(
                    f"{path} is a scene, and --shape and --drive are of recorded "
                    "drives; leave them out"
                )
            return scene
    body = model.body if model else ROVER
    if arguments.body:
        body = read_body(arguments.body)
    shape = arguments.shape or ("rover" if body == ROVER else "husky")
    robot = SYSTEMS["system1"].novice if shape == "rover" else find_box(shape)
    drives = read_drives(path, body, allow_constant=True)
    if not 0 <= arguments.drive < len(drives):
        raise ConfigError(
            f"{path}: it has drives 0 to {len(drives) - 1}, not {arguments.drive}"
        )
    drive = drives[arguments.drive]
    if model is None:
        return drives_scene([drive], robot)
    predicted = model.rollout(drive.states[0], drive.actions, ground=drive.ground)
    return predicted_scene(drive, predicted, robot)
