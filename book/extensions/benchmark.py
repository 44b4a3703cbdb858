"""Sphinx extension: write the benchmark's table from its stored rows."""

from __future__ import annotations

from pathlib import Path

from sphinx.application import Sphinx

from companion.tasks.page import write_page
from companion.tasks.run import newest
from companion.tasks.scores import results_frame

TABLE = "book/benchmark-table.html"  # where pages link to


def write_table(app: Sphinx, error: Exception | None) -> None:
    """Write the table beside the page on the benchmark."""
    if error is None and app.builder.format == "html":
        rows = newest(Path(app.confdir) / "results")
        write_page(results_frame(rows), Path(app.outdir) / TABLE)


def setup(app: Sphinx) -> dict[str, object]:
    """Register with Sphinx."""
    app.connect("build-finished", write_table)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
