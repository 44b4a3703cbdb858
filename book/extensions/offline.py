"""Sphinx extension: pages that need nothing from another host.

MathJax comes from a pinned Python package and is copied into the rendered book (one
script and its fonts, not the 35 MB around them); scripts that other extensions would
load from elsewhere are left out.
"""

from __future__ import annotations

import importlib.util
import shutil
from pathlib import Path

from sphinx.application import Sphinx
from sphinx.errors import ExtensionError

MATHJAX = ("tex-chtml-full.js", "output/chtml/fonts/woff-v2")
#: live cells: would load a kernel's client from another host when clicked
REFUSED = ("thebe",)


def copy_mathjax(app: Sphinx, error: Exception | None) -> None:
    """Copy the files of `MATHJAX` from the installed package to _static/mathjax."""
    if error or app.builder.format != "html":
        return
    package = importlib.util.find_spec("mathjax")
    if package is None or package.origin is None:
        raise ExtensionError(
            "MathJax is not installed; 'pip install -r requirements.txt' brings django-static-mathjax"
        )
    source = Path(package.origin).parent / "static" / "mathjax" / "es5"
    target = Path(app.outdir) / "_static" / "mathjax"
    for name in MATHJAX:
        (target / name).parent.mkdir(parents=True, exist_ok=True)
        if (source / name).is_dir():
            shutil.copytree(source / name, target / name, dirs_exist_ok=True)
        else:
            shutil.copyfile(source / name, target / name)


def refuse_scripts(
    app: Sphinx, page: str, template: str, context: dict, doctree: object
) -> None:
    """Take out of a page's head the scripts that fetch from another host."""
    scripts = context.get("script_files", [])
    context["script_files"] = [
        script
        for script in scripts
        if not str(getattr(script, "filename", script)).startswith(
            ("http:", "https:", "//")
        )
        and not any(
            word
            in f"{getattr(script, 'filename', '')}{getattr(script, 'attributes', {})}"
            for word in REFUSED
        )
    ]


def setup(app: Sphinx) -> dict[str, object]:
    """Register with Sphinx."""
    app.connect("build-finished", copy_mathjax)
    app.connect("html-page-context", refuse_scripts, priority=900)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
