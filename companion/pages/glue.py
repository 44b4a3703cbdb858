"""Notebook outputs for MyST-NB's `{glue}` role, by which other pages show them."""

from __future__ import annotations

import functools
import json
from pathlib import Path
from typing import Any

from IPython.core.formatters import format_display_data
from IPython.display import display

#: prefix of the MIME types of an output that the notebook itself does not show
HIDDEN = "application/papermill.record/"


def glue(name: str, value: Any) -> None:
    """Store `value` under a name in the notebook's outputs, without showing it.

    MyST-NB's function `glue` does the same, but takes a second to import.
    """
    formats, metadata = format_display_data(value)
    display(
        {f"{HIDDEN}{mime_type}": data for mime_type, data in formats.items()},
        metadata={**metadata, "scrapbook": {"mime_prefix": HIDDEN, "name": name}},
        raw=True,
    )


def glued(notebook: Path, name: str) -> str:
    """The text that a stored notebook glued under a name; else ValueError."""
    for output in outputs(notebook):
        if output.get("metadata", {}).get("scrapbook", {}).get("name") == name:
            return "".join(output["data"][f"{HIDDEN}text/plain"]).strip("'")
    raise ValueError(f"{notebook.name} glues no '{name}'")


@functools.cache
def outputs(notebook: Path) -> tuple[dict[str, Any], ...]:
    """The outputs of a stored notebook in their order, read once in a process."""
    cells = json.loads(notebook.read_text(encoding="utf-8"))["cells"]
    return tuple(output for cell in cells for output in cell.get("outputs", ()))
