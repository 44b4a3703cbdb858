"""Sphinx extension: make pages that load nothing from another host.

MathJax comes from a pinned Python package. One script and its fonts are copied into the
rendered book, not the whole package of 35 MB. Scripts that other extensions would load
from another host are removed.
"""

from __future__ import annotations

import importlib.util
import shutil
from pathlib import Path

from sphinx.application import Sphinx
from sphinx.errors import ExtensionError

MATHJAX = ("tex-chtml-full.js", "output/chtml/fonts/woff-v2")
#: scripts for live cells, which would load a client from another host when clicked
REFUSED = ("thebe",)


def copy_mathjax(app: Sphinx, error: Exception | None) -> None:
    """Copy the files of `MATHJAX` from the installed package to _static/mathjax."""
    if error or app.builder.format != "html":
        return
    package = importlib.util.find_spec("mathjax")
    if package is None or package.origin is None:
        raise ExtensionError(
            "MathJax is not installed; "
            "'pip install -r requirements.txt' brings django-static-mathjax"
        )
    source = Path(package.origin).parent / "static" / "mathjax" / "es5"
    target = Path(app.outdir) / "_static" / "mathjax"
    for name in MATHJAX:
        (target / name).parent.mkdir(parents=True, exist_ok=True)
        if (source / name).is_dir():
            shutil.copytree(source / name, target / name, dirs_exist_ok=True)
        else:
            shutil.copyfile(source / name, target / name)


def is_local(script: object) -> bool:
    """Whether a script loads nothing from another host."""
    name = getattr(script, "filename", script)
    described = f"{getattr(script, 'filename', '')}{getattr(script, 'attributes', {})}"
    return not str(name).startswith(("http:", "https:", "//")) and not any(
        word in described for word in REFUSED
    )


def refuse_scripts(
    app: Sphinx, page: str, template: str, context: dict, doctree: object
) -> None:
    """Remove from a page's head the scripts that load from another host."""
    scripts = context.get("script_files", [])
    context["script_files"] = [script for script in scripts if is_local(script)]


def setup(app: Sphinx) -> dict[str, object]:
    """Register with Sphinx."""
    app.connect("build-finished", copy_mathjax)
    app.connect("html-page-context", refuse_scripts, priority=900)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
