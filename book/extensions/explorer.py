"""Sphinx extension: the scripts of the suspension explorer's page, made from the stored rides."""

from __future__ import annotations

from pathlib import Path

from sphinx.application import Sphinx

from sidm.explorer import grid, page


def write_scripts(app: Sphinx, error: Exception | None) -> None:
    """Put Vega and the rides into _static/explorer."""
    if error is None and app.builder.format == "html":
        page.write(Path(app.outdir) / "_static" / "explorer", grid.read(Path(app.confdir) / grid.FOLDER))


def setup(app: Sphinx) -> dict[str, object]:
    """Register with Sphinx."""
    app.connect("build-finished", write_scripts)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
