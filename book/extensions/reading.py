"""Sphinx extension: show under the title how many minutes a page takes to read.

Folded text, code and tables do not count.
"""

from __future__ import annotations

import re
from typing import Any

from sphinx.application import Sphinx

PACE = 200  # words a minute
UNREAD = re.compile(r"<(details|pre|table|script|style|math)\b.*?</\1>", re.DOTALL)
#: beginnings of the names of pages that nobody reads from top to bottom
REFERENCE = ("book/api", "genindex", "search")


def minutes(body: str) -> int:
    """Minutes to read a page's HTML, at least 1."""
    words = re.sub(r"<[^>]+>", " ", UNREAD.sub(" ", body)).split()
    return max(1, round(len(words) / PACE))


def add_minutes(
    app: Sphinx, name: str, template: str, context: dict[str, Any], doctree: Any
) -> None:
    """Write the minutes below the title of a page."""
    body = context.get("body")
    if body and not name.startswith(REFERENCE):
        note = f'<p class="reading-time">{minutes(body)} min to read</p>'
        context["body"] = body.replace("</h1>", f"</h1>\n{note}", 1)


def setup(app: Sphinx) -> dict[str, object]:
    """Register with Sphinx."""
    app.connect("html-page-context", add_minutes)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
