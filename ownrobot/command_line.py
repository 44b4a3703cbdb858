"""Parts that the commands `ownrobot` and `companion` share; every error is one line.

Exit status: 0; 1 when something failed or is still missing; 2 for arguments that cannot
be used.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import os
import re
import sys
import warnings
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import BrokenExecutor
from typing import Any, NoReturn, TextIO

from sidm.config import ConfigError, DataError, Notice, first_line, hint

#: Adds a command and returns its own parser. The arguments are the command's name, the
#: function that runs it and returns the exit status, its help, and perhaps examples.
AddCommand = Callable[..., argparse.ArgumentParser]

GOES_ON = "the same command goes on where this one was"


class Parser(argparse.ArgumentParser):
    """A parser whose errors are one line."""

    def error(self, message: str) -> NoReturn:
        """Print the error and where to find help, and exit with status 2."""
        program, line = self.prog.split()[0], " ".join(message.split())
        line = _about_command(line) or f"{line};"
        self.exit(2, f"{program}: {line} see {self.prog} --help\n")


def _about_command(message: str) -> str:
    """The error for a command that is missing or not known; '' for another message."""
    missing = "the following arguments are required: "
    if message.startswith(missing) and " | " in message:
        names = message.removeprefix(missing).split(" | ")
        return f"name a command, {', '.join(names)};"
    pattern = r"argument .* \| .*: invalid choice: '(.*)' \(choose from (.*)\)"
    found = re.match(pattern, message)
    if not found:
        return ""
    names = [name.strip(" '") for name in found[2].split(",")]
    return f"unknown command '{found[1]}'; {hint(found[1], names)}"


def command_adder(parser: argparse.ArgumentParser, names: Sequence[str]) -> AddCommand:
    """A function that adds commands to `parser`; its help lists the `names`."""
    commands = parser.add_subparsers(metavar=" | ".join(names), required=True)

    def add(name: str, work: Any, help: str, examples: str = "") -> Any:
        command = commands.add_parser(name, help=help, description=help)
        if examples:  # are printed line by line, as they are
            command.formatter_class = argparse.RawDescriptionHelpFormatter
            command.epilog = f"examples:\n{examples}"
        command.set_defaults(work=work)
        return command

    return add


def carry_out(
    parser: argparse.ArgumentParser, arguments: Sequence[str] | None = None
) -> int:
    """Run the command that `arguments` name; an error is one line on stderr.

    Each `Notice` is a line, too. Returns the exit status, 1 or 2 after an error.
    """
    parsed = parser.parse_args(arguments)
    try:
        with warnings.catch_warnings():
            print_notices(sys.stderr)
            return _to_open_pipe(parsed)
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


def _to_open_pipe(parsed: argparse.Namespace) -> int:
    """Run the command; whoever reads its output may stop reading, as `head` does."""
    if sys.stdout is None:  # it was closed by who started the command
        sys.stdout = open(os.devnull, "w", encoding="utf-8")
    if isinstance(sys.stdout, io.TextIOWrapper):  # signs that a terminal lacks
        sys.stdout.reconfigure(errors="replace")
    try:
        status = parsed.work(parsed)
        sys.stdout.flush()
        return status
    except BrokenPipeError:
        # The interpreter flushes the output once more as it ends.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0


def print_notices(file: TextIO) -> None:
    """From now on print each `Notice` as one line; other warnings stay as they are."""
    warnings.simplefilter("always", Notice)
    others = warnings.showwarning

    def show(message, category, *arguments, **options):  # type: ignore[no-untyped-def]
        if issubclass(category, Notice):
            print(f"note: {first_line(message)}", file=file)
        else:
            others(message, category, *arguments, **options)

    warnings.showwarning = show


def whole_number(text: str, least: int = 1) -> int:
    """The whole number that `text` holds; argparse reports one below `least`."""
    number = int(text)
    if number < least:
        raise argparse.ArgumentTypeError(f"must be at least {least}, not {number}")
    return number


def parse_value(text: str, name: str) -> Any:
    """The value that a text on the command line stands for, read as YAML."""
    import yaml

    try:
        value = yaml.safe_load(text)
    except yaml.YAMLError:
        raise ConfigError(f"'{name}' cannot be read as YAML: {text!r}") from None
    if isinstance(value, str):  # YAML 1.1 takes 1e-3 for text
        with contextlib.suppress(ValueError):
            return float(value)
    return value


def parse_changes(texts: Iterable[str]) -> dict[str, Any]:
    """Name -> value from texts such as 'seeds=5', the arguments of `--set`."""
    values: dict[str, Any] = {}
    for text in texts:
        name, equals, value = text.partition("=")
        if not equals:
            raise ConfigError(f"--set takes NAME=VALUE, not '{text}'")
        values[name] = parse_value(value, f"--set {name}")
    return values
