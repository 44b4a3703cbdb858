"""The library's command line, whose commands `sidm --help` lists."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

from sidm import __version__
from sidm.command_line import Parser, adder, carry_out
from sidm.commands import add_demo, add_fitting, add_replay

DESCRIPTION = "Dynamics models of your own robot from recorded drives. Exit status: 0; 1 when something failed; 2 for "
DESCRIPTION += "arguments that cannot be used."


def build_parser() -> argparse.ArgumentParser:
    """The parser of the whole command line."""
    parser = Parser(prog="sidm", description=DESCRIPTION)
    parser.add_argument("--version", action="version", version=__version__)
    add = adder(parser, ("demo", "fit", "evaluate", "predict", "replay"))
    add_demo(add)
    add_fitting(add)
    add_replay(add)
    return parser


def main(words: Sequence[str] | None = None) -> int:
    """Carry out a command line and return its exit status; errors are one line on stderr."""
    return carry_out(build_parser(), words)


if __name__ == "__main__":
    sys.exit(main())
