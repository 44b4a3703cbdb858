"""Sphinx extension: write the reference, one page for each module.

`autosummary` finds the modules, which book/extending lists, and writes the sources of
their pages into book/api, which git ignores. The everyday tests name the modules that
they want, each with its submodules, as `only` in Sphinx's `autosummary_context`.
"""

from __future__ import annotations

import pkgutil
import re
import sys
from importlib.util import find_spec
from pathlib import Path

from sphinx.application import Sphinx
from sphinx.config import Config
from sphinx.ext import autosummary
from sphinx.ext.autodoc.mock import mock
from sphinx.ext.autosummary.generate import generate_autosummary_docs

import companion
import ownrobot
import sidm

PAGES = "book/api"
LIST = "book/extending.md"
TITLE = re.compile(r"(?<=<h1>)[\w.]+")


def read_modules(app: Sphinx, config: Config) -> None:
    """Let Sphinx read all modules and their pages, which no contents list."""
    config.exclude_patterns = [
        name for name in config.exclude_patterns if not name.startswith(f"{PAGES}/")
    ]
    if find_spec("triton") is None:  # of the kernels; PyTorch for CPUs is without it
        config.autodoc_mock_imports = ["triton"]


def write_sources(app: Sphinx) -> None:
    """Write the sources of the pages of all modules.

    `autosummary` alone would look for modules only in changed sources. Once a module is
    gone, all sources are deleted first.
    """
    packages = (sidm, ownrobot, companion)
    modules = {package.__name__ for package in packages} | {
        module.name
        for package in packages
        for module in pkgutil.walk_packages(package.__path__, f"{package.__name__}.")
    }
    modules.intersection_update(app.config.autosummary_context.get("only", modules))
    sources = list((Path(app.srcdir) / PAGES).glob("*.rst"))
    if not modules.issuperset(path.stem for path in sources):
        while sources:  # the sources of other modules may name the one that is gone
            sources.pop().unlink()
    with mock(app.config.autodoc_mock_imports):
        generate_autosummary_docs(
            [LIST, *map(str, sources)], base_path=app.srcdir, app=app
        )


def break_title(
    app: Sphinx, page: str, template: str, context: dict, doctree: object
) -> None:
    """Let the name of a module break after a dot, not in the middle of a word."""
    body = context.get("body")
    if page.startswith(f"{PAGES}/") and body:
        context["body"] = TITLE.sub(
            lambda name: name[0].replace(".", ".<wbr>"), body, count=1
        )


def setup(app: Sphinx) -> dict[str, object]:
    """Register with Sphinx, after the extensions that exclude files."""
    plain = autosummary._import_by_name

    def modules_first(
        name: str, *args: bool, **options: bool
    ) -> tuple[object, object, str]:
        """Import a module where a function of its package has the same name."""
        thing, parent, place = plain(name, *args, **options)
        return sys.modules.get(name, thing), parent, place

    autosummary._import_by_name = modules_first
    app.connect("config-inited", read_modules, priority=950)
    app.connect("builder-inited", write_sources)
    app.connect("html-page-context", break_title)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
