"""Notebook outputs for MyST-NB's `{glue}` role, by which other pages show them."""

from __future__ import annotations

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
