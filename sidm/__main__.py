"""The command line of the library; `sidm --help` lists its commands."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

from sidm import __version__
from sidm.command_line import Parser, carry_out, command_adder
from sidm.commands.demo import add_demo
from sidm.commands.fitting import add_fitting
from sidm.commands.replay import add_replay

DESCRIPTION = (
    "Dynamics models of your own robot from recorded drives. Exit status: 0; 1 when "
    "something failed; 2 for arguments that cannot be used."
)


def build_parser() -> argparse.ArgumentParser:
    """The parser of the whole command line."""
    parser = Parser(prog="sidm", description=DESCRIPTION)
    parser.add_argument("--version", action="version", version=__version__)
    add = command_adder(parser, ("demo", "fit", "evaluate", "predict", "replay"))
    add_demo(add)
    add_fitting(add)
    add_replay(add)
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command and return its exit status; an error is one line on stderr.

    Args:
        arguments: the command and its options; by default those of the process.
    """
    return carry_out(build_parser(), arguments)


if __name__ == "__main__":
    sys.exit(main())
