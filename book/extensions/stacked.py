"""Sphinx extension: on narrow pages a figure's plots stand one below the other.

`companion.figures.stacked` writes where the plots are into a figure's PNG file. Below
the picture come its parts, cut out by SVG; book.css shows the one or the other.
"""

from __future__ import annotations

import json
import re
from html import escape, unescape
from pathlib import Path
from statistics import median
from typing import Any

from PIL import Image
from sphinx.application import Sphinx

from companion.figures.stacked import KEY

PICTURE = re.compile(
    r"<img [^>]*\bsrc=\"(?P<address>[^\"]*/(?P<name>[^\"/]+\.png))\"[^>]*>"
)
ALT = re.compile(r"\balt=\"([^\"]*)\"")


def stacked(tag: str, address: str, file: Path) -> str:
    """HTML of the parts of a picture, below each other; '' where they are not known.

    Plots become as wide as the page, and the rest grows with them.
    """
    with Image.open(file) as picture:
        places = json.loads(getattr(picture, "text", {}).get(KEY, "{}"))
        size = picture.size
    if not places.get("plots"):
        return ""
    usual = median(sum(part[2] for part in row) for row in places["plots"])
    named = ALT.search(tag)
    alt = escape(unescape(named[1])) if named else ""
    lines = []
    for row in [*places["title"], *places["plots"], *places["legend"]]:
        whole = usual if row in places["legend"] else sum(part[2] for part in row)
        whole = max(whole, usual)
        parts = [_part(part, address, size, part[2] / whole) for part in row]
        lines.append(f"<div>{''.join(parts)}</div>")
    return f'<div class="stacked" role="img" aria-label="{alt}">{"".join(lines)}</div>'


def _part(part: list[int], address: str, size: tuple[int, int], share: float) -> str:
    """A part of a picture, or a spacer where its height is 0."""
    left, top, width, height = part
    style = f'style="width:{100 * min(share, 1):.2f}%"'
    if not height:
        return f"<span {style}></span>"
    image = f'<image href="{address}" width="{size[0]}" height="{size[1]}"/>'
    return f'<svg viewBox="{left} {top} {width} {height}" {style}>{image}</svg>'


def stack(
    app: Sphinx, page: str, template: str, context: dict[str, Any], doctree: Any
) -> None:
    """Put the parts of each picture of a page below it."""
    if not context.get("body") or app.builder.format != "html":
        return
    files = {name: path for path, name in app.builder.images.items()}

    def with_parts(match: re.Match[str]) -> str:
        path = files.get(match["name"])
        parts = (
            stacked(match[0], match["address"], Path(app.srcdir, path)) if path else ""
        )
        return match[0] + parts

    context["body"] = PICTURE.sub(with_parts, context["body"])


def setup(app: Sphinx) -> dict[str, object]:
    """Register with Sphinx."""
    app.connect("html-page-context", stack)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
