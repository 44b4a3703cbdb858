"""The command `ownrobot demo`."""

from __future__ import annotations

import argparse

from ownrobot.command_line import AddCommand
from ownrobot.commands.tables import errors_text


def add_demo(add: AddCommand) -> None:
    """Add `ownrobot demo`."""
    demo = add(
        "demo",
        run_demo,
        "A model of a real robot in half a minute, from drives that come with sidm.",
    )
    text = "folder of what is made (%(default)s)"
    demo.add_argument("--out", metavar="DIR", default="ownrobot-demo", help=text)


def run_demo(arguments: argparse.Namespace) -> int:
    """Run `ownrobot demo`: it prints the model, its errors and what to do next."""
    from ownrobot.demo import run

    demo = run(arguments.out)
    print(
        f"{demo.model}, {demo.training_drives} drives of a Warthog; "
        f"its errors on {demo.held_out_drives} others:"
    )
    print(errors_text(demo.errors))
    print(f"model: {demo.page.parent / 'model'}")
    print(
        f"replay: {demo.page}; open it in a browser: "
        "the ghost is where the model says that the robot would be"
    )
    return 0
