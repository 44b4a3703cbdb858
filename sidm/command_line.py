"""Parts that the command lines of both packages share; every error is one line.

Exit status: 0; 1 when something failed or is still missing; 2 for arguments that cannot
be used.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from concurrent.futures import BrokenExecutor
from typing import NoReturn

from sidm.config import ConfigError, DataError, first_line

#: Runs a command with its parsed arguments and returns the exit status.
Command = Callable[[argparse.Namespace], int]
#: Adds a command to a parser: its name, its function, its help; returns its own parser.
AddCommand = Callable[[str, Command, str], argparse.ArgumentParser]

GOES_ON = "the same command goes on where this one was"


class Parser(argparse.ArgumentParser):
    """A parser whose errors are one line."""

    def error(self, message: str) -> NoReturn:
        """Print the error and where to find help, and exit with status 2."""
        program, line = self.prog.split()[0], " ".join(message.split())
        self.exit(2, f"{program}: {line}; see {self.prog} --help\n")


def command_adder(parser: argparse.ArgumentParser, names: Sequence[str]) -> AddCommand:
    """A function that adds commands to `parser`; its help lists the `names`."""
    commands = parser.add_subparsers(metavar=" | ".join(names), required=True)

    def add(name: str, work: Command, help: str) -> argparse.ArgumentParser:
        command = commands.add_parser(name, help=help, description=help)
        command.set_defaults(work=work)
        return command

    return add


def carry_out(
    parser: argparse.ArgumentParser, arguments: Sequence[str] | None = None
) -> int:
    """Run the command that `arguments` name and return its exit status.

    Args:
        parser: knows the commands; `command_adder` added them.
        arguments: the command and its options; by default those of the process.

    Returns:
        The command's own exit status, 1 or 2 after an error, which is one line on
        stderr.
    """
    parsed = parser.parse_args(arguments)
    try:
        return parsed.work(parsed)
    except ConfigError as error:
        status, line = 2, first_line(error)
    except BrokenExecutor:
        status, line = 1, f"a worker was killed (out of memory?); {GOES_ON}"
    except KeyboardInterrupt:
        status, line = 1, f"stopped; {GOES_ON}"
    except (DataError, OSError, ImportError, RuntimeError) as error:
        status, line = 1, first_line(error)
    print(f"{parser.prog}: {line}", file=sys.stderr)
    return status


def whole_number(text: str, least: int = 1) -> int:
    """The whole number that `text` holds; argparse reports one below `least`."""
    number = int(text)
    if number < least:
        raise argparse.ArgumentTypeError(f"must be at least {least}, not {number}")
    return number
