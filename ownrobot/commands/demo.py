"""The command `ownrobot demo`: a model of a real robot in half a minute."""

from __future__ import annotations

import argparse
from pathlib import Path

from ownrobot.command_line import AddCommand
from ownrobot.commands.tables import errors_text

HELD_OUT = 0.25  # share of the sessions, which evaluate the model


def add_demo(add: AddCommand) -> None:
    """Add `ownrobot demo`."""
    text = "A model of a real robot in half a minute, from drives that come with sidm."
    demo = add("demo", run_demo, text)
    text = "folder of what is made (%(default)s)"
    demo.add_argument("--out", metavar="DIR", default="ownrobot-demo", help=text)


def run_demo(arguments: argparse.Namespace) -> int:
    """Run `ownrobot demo`: it prints the model, its errors and what to do next.

    Least squares learn from a part of the drives; the replay shows the drive of the
    others that turns most.
    """
    from ownrobot.demo import bundled_drives
    from ownrobot.fitting.fit import fit
    from ownrobot.fitting.splits import split
    from ownrobot.replay.scene import drive_scene
    from ownrobot.replay.skeleton import BOXES
    from ownrobot.replay.viewer import View

    folder = Path(arguments.out)
    training, held_out = split(bundled_drives(), HELD_OUT, seed=0)
    model = fit(training, method="least_squares", out=folder / "model")
    drive = max(held_out, key=lambda one: abs(one.states[-1, 2] - one.states[0, 2]))
    path = model.rollout(drive.states[0], drive.actions)
    scene = drive_scene(drive, BOXES["warthog"], path)
    View(scene, "A Warthog and its model").write(folder / "replay.html")
    print(
        f"{model}, {len(training)} drives of a Warthog; "
        f"its errors on {len(held_out)} others:"
    )
    print(errors_text(model.evaluate(held_out)))
    print(f"model: {folder / 'model'}")
    print(
        f"replay: {folder / 'replay.html'}; open it in a browser: "
        "the ghost is where the model says that the robot would be"
    )
    return 0
