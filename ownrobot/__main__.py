"""The command line; `ownrobot --help` lists its commands."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

from ownrobot.command_line import Parser, carry_out, command_adder
from ownrobot.commands.demo import add_demo
from ownrobot.commands.fitting import add_compare, add_evaluate, add_fit, add_predict
from ownrobot.commands.recordings import add_body, add_check
from ownrobot.commands.replay import add_replay
from sidm import __version__

DESCRIPTION = (
    "Dynamics models of your own robot from recorded drives. Exit status: 0; 1 when "
    "something failed; 2 for arguments that cannot be used."
)
COMMANDS = "demo check body fit compare evaluate predict replay".split()


def build_parser() -> argparse.ArgumentParser:
    """The parser of the whole command line."""
    parser = Parser(prog="ownrobot", description=DESCRIPTION)
    parser.add_argument("--version", action="version", version=__version__)
    add = command_adder(parser, COMMANDS)
    looking, using = (add_check, add_body), (add_evaluate, add_predict, add_replay)
    for add_one in (add_demo, *looking, add_fit, add_compare, *using):
        add_one(add)
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command and return its exit status; an error is one line on stderr."""
    return carry_out(build_parser(), arguments)


if __name__ == "__main__":
    sys.exit(main())
