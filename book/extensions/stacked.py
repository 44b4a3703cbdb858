"""Sphinx extension: on narrow pages a figure's plots stand one below the other.

`companion.figures.stacked` writes where the plots are into a figure's PNG file. Below
the picture come its parts, cut out by SVG; book.css shows the one or the other.
"""

from __future__ import annotations

import base64
import hashlib
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
#: a picture that a page shows of another page, see `companion.figures.style.html_plots`
INLINE = re.compile(
    r"(?P<tag><img class=\"plots\" src=\")data:image/png;base64,([^\"]+)"
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
    folder = app.builder.imagedir
    files = {name: Path(app.srcdir, path) for path, name in app.builder.images.items()}

    def in_file(match: re.Match[str]) -> str:
        content = base64.b64decode(match[2])
        name = f"{hashlib.sha256(content).hexdigest()[:20]}.png"
        files[name] = Path(app.outdir, folder, name)
        files[name].parent.mkdir(exist_ok=True)
        files[name].write_bytes(content)
        return match["tag"] + context["pathto"](f"{folder}/{name}", resource=True)

    def with_parts(match: re.Match[str]) -> str:
        file = files.get(match["name"])
        return match[0] + (stacked(match[0], match["address"], file) if file else "")

    body = INLINE.sub(in_file, context["body"])
    context["body"] = PICTURE.sub(with_parts, body)


def setup(app: Sphinx) -> dict[str, object]:
    """Register with Sphinx."""
    app.connect("html-page-context", stack)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
