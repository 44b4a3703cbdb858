"""What both command lines share: errors are one line, and the exit status says whose fault they are.

Exit status: 0; 1 when something failed or is still missing; 2 for arguments that cannot
be used.
"""

from __future__ import annotations

import argparse
import functools
import sys
from collections.abc import Callable, Sequence
from concurrent.futures import BrokenExecutor
from typing import NoReturn

from sidm.config import ConfigError, Fault, first_line

Work = Callable[[argparse.Namespace], int]
Adds = Callable[[str, Work, str], argparse.ArgumentParser]


class Parser(argparse.ArgumentParser):
    """A parser whose errors are one line."""

    def error(self, message: str) -> NoReturn:
        """Say what is wrong and where help is, and end with status 2."""
        program = self.prog.split()[0]
        self.exit(
            2, f"{program}: {' '.join(message.split())}; see {self.prog} --help\n"
        )


def adder(parser: argparse.ArgumentParser, names: Sequence[str]) -> Adds:
    """What adds commands of these `names` to a parser: a name, what does its work, its help."""
    commands = parser.add_subparsers(metavar=" | ".join(names), required=True)

    def add(name: str, work: Work, help: str) -> argparse.ArgumentParser:
        made = commands.add_parser(name, help=help, description=help)
        made.set_defaults(work=work)
        return made

    return add


def carry_out(
    parser: argparse.ArgumentParser, words: Sequence[str] | None = None
) -> int:
    """Carry out a command line and return its exit status; errors are one line on stderr."""
    arguments = parser.parse_args(words)
    fail = functools.partial(_fail, parser.prog)
    try:
        return arguments.work(arguments)
    except ConfigError as error:
        return fail(error, 2)
    except BrokenExecutor:
        return fail(
            "a worker was killed (out of memory?); the same command goes on where this one was",
            1,
        )
    except KeyboardInterrupt:
        return fail("stopped; the same command goes on where this one was", 1)
    except (Fault, OSError, ImportError, RuntimeError) as error:
        return fail(error, 1)


def _fail(program: str, error: object, status: int) -> int:
    print(f"{program}: {first_line(error)}", file=sys.stderr)
    return status


def whole_number(text: str, least: int = 1) -> int:
    """A whole number of at least `least`; argparse reports any other."""
    number = int(text)
    if number < least:
        raise argparse.ArgumentTypeError(f"must be at least {least}, not {number}")
    return number
