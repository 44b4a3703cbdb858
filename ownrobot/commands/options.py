"""Options that several commands share, and texts of their help."""

from __future__ import annotations

import argparse
import math
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from sidm.config import ConfigError

DRIVES = "drives: files, ROS bags, or folders of files; NAME=PATH names their session"


def add_robot_options(command: argparse.ArgumentParser) -> None:
    """Add an expert's drives, the bodies of both robots, and how drives are read."""
    text = "drives of another robot, whose motion is cheaper"
    command.add_argument("--expert", metavar="PATH", nargs="+", help=text)
    text = "what the drives are made of, YAML"
    command.add_argument("--body", metavar="FILE", required=True, help=text)
    text = "what the expert's drives are made of, YAML (as --body)"
    command.add_argument("--expert-body", metavar="FILE", help=text)
    add_reading_options(command)


def add_model_options(command: argparse.ArgumentParser) -> None:
    """Add a model, and drives of its robot."""
    text = "folder of a model that 'ownrobot fit' made"
    command.add_argument("model", metavar="MODEL", help=text)
    command.add_argument("drives", metavar="PATH", nargs="+", help=DRIVES)
    add_reading_options(command)


def add_reading_options(command: argparse.ArgumentParser) -> None:
    """Add how drives are read."""
    text = "topics of ROS bags that are read, where several could be meant (all)"
    command.add_argument("--topics", metavar="NAME", nargs="+", default=[], help=text)
    text = "leave out drives that have a fault, and name them"
    command.add_argument("--skip-bad", action="store_true", help=text)


def add_settings(command: argparse.ArgumentParser, text: str) -> None:
    """Add `--set`, whose values are `changes`."""
    options: dict[str, Any] = {"action": "append", "default": [], "dest": "changes"}
    command.add_argument("--set", metavar="NAME=VALUE", help=text, **options)


def refuse_inputs(outputs: Iterable[str | None], inputs: Iterable[str | None]) -> None:
    """Raise ConfigError for a file to write that has no name or is read, too."""
    from ownrobot.recordings.reading import session_and_path

    given = [session_and_path(path)[1] for path in inputs if path]
    read = [path for path in given if path.exists()]
    read += [file for path in read if path.is_dir() for file in path.rglob("*")]
    written: set[Path] = set()
    for output in outputs:
        if output is None:
            continue
        if Path(output).resolve() in written:
            raise ConfigError(f"{output} is written twice; name another file")
        written.add(Path(output).resolve())
        if not output.strip():
            raise ConfigError("a file to write has no name; pass a path")
        path = Path(output)
        if path.is_dir():
            raise ConfigError(f"{output} is a folder; name a file to write")
        if path.exists() and any(path.samefile(other) for other in read):
            raise ConfigError(f"{output} is read, too; name another file to write")


def methods_text() -> str:
    """The methods of `ownrobot fit`, a line each."""
    from ownrobot.methods.registry import METHODS

    width = max(map(len, METHODS))
    return "\n".join(
        f"  {name:{width}}  {method.label}" for name, method in METHODS.items()
    )


def seconds(text: str) -> float:
    """The time in a text such as '3s', '0.5 s' or '3'; argparse reports others."""
    try:
        value = float(text.strip().removesuffix("s"))
    except ValueError:
        value = math.nan
    if not 0 < value < math.inf:
        raise argparse.ArgumentTypeError(f"a time is as 3s, not '{text}'")
    return value
