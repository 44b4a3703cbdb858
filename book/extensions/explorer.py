"""Sphinx extension: write the scripts of the explorer's and the replay's pages.

The scripts hold the stored rides and scenes.
"""

from __future__ import annotations

from pathlib import Path

from sphinx.application import Sphinx

from companion.explorer import grid, page


def write_scripts(app: Sphinx, error: Exception | None) -> None:
    """Write Vega, the replay and the rides to _static/explorer."""
    if error is None and app.builder.format == "html":
        stored = Path(app.confdir) / grid.FOLDER
        page.write(Path(app.outdir) / "_static" / "explorer", grid.read(stored), stored)


def setup(app: Sphinx) -> dict[str, object]:
    """Register with Sphinx."""
    app.connect("build-finished", write_scripts)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
