"""Results that a notebook keeps for other pages, in the form that MyST-NB's `{glue}` takes them over from there."""

from __future__ import annotations

from typing import Any

from IPython.core.formatters import format_display_data
from IPython.display import display

#: before the kinds of an output that is not shown where it is made
KEPT = "application/papermill.record/"


def glue(name: str, thing: Any) -> None:
    """Keep `thing` under a name without showing it.

    MyST-NB's function of that name does the same and takes a second to import, for it
    brings the check of notebooks.
    """
    kinds, about = format_display_data(thing)
    kept = {f"{KEPT}{kind}": value for kind, value in kinds.items()}
    display(
        kept,
        metadata={**about, "scrapbook": {"mime_prefix": KEPT, "name": name}},
        raw=True,
    )
