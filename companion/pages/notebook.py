"""The project's folder and its notebooks by name."""

from __future__ import annotations

import os
import re
import sys
from pathlib import Path

from ownrobot.command_line import print_notices
from sidm.config import ConfigError, hint


def project_root(start: Path | None = None) -> Path:
    """The project's folder: the nearest above `start` with notebooks and this package.

    `start` is the working folder by default. Where there is none, it is the folder of
    this file's project.
    """
    start = Path(start or Path.cwd()).resolve()
    for folder in (start, *start.parents):
        parts = (folder / "notebooks", folder / "companion" / "pages")
        if all(part.is_dir() for part in parts):
            return folder
    return Path(__file__).resolve().parents[2]


def enter_project() -> Path:
    """Make the project's folder the working folder, and return it.

    Then `results` and `data` are the project's, however a notebook is run. Notices are
    lines of the page, as on the command line; figures can be stacked on narrow pages.
    """
    from companion.figures.stacked import show_stackable

    print_notices(sys.stdout)
    show_stackable()
    root = project_root()
    os.chdir(root)
    return root


def notebooks(root: Path | None = None) -> list[Path]:
    """The project's notebooks in reading order."""
    return sorted((root or project_root()).glob("notebooks/*.ipynb"))


def find_notebook(name: str) -> Path:
    """The notebook with this path or name, with or without its number, as `04-figure3`.

    ConfigError says that there is none, and the nearest name.
    """
    if Path(name).is_file():
        return Path(name)
    known = {path.stem: path for path in notebooks()}
    wanted = _without_number(Path(name).name.removesuffix(".ipynb"))
    for stem, path in known.items():
        if wanted == _without_number(stem):
            return path
    raise ConfigError(f"no notebook '{name}'; {hint(name, known)}")


def _without_number(stem: str) -> str:
    return re.sub(r"^\d+-", "", stem)
