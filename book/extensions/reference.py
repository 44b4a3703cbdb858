"""Sphinx extension: write the reference, one page for each module.

A table of the packages' folders, the rooms, leads to the pages. `autosummary` finds the
modules and writes the sources of their pages into book/api, which git ignores.
"""

from __future__ import annotations

import pkgutil
import re
import sys
from pathlib import Path

from docutils import nodes
from docutils.statemachine import StringList
from sphinx.application import Sphinx
from sphinx.config import Config
from sphinx.ext import autosummary
from sphinx.ext.autosummary.generate import generate_autosummary_docs
from sphinx.util.docutils import SphinxDirective

import companion
import ownrobot
import sidm

PAGES = "book/api"
DESIGN = "book/design.md"
ROOM = re.compile(
    r"^\| (`(?:sidm|ownrobot|companion)\..+?) \| (.+?) \| .*\|$", re.MULTILINE
)
#: `ownrobot.__main__` has no page
LINKED = re.compile(r"`(?=(?:sidm|ownrobot|companion)\.[a-z])")
TITLE = re.compile(r"(?<=<h1>)[\w.]+")


class Rooms(SphinxDirective):
    """Directive `rooms`: a linked table of the rooms of the packages.

    The rows and their order come from the page on the design of the code.
    """

    def run(self) -> list[nodes.Node]:
        """Make the table from the table of that page."""
        design = Path(self.env.srcdir) / DESIGN
        self.env.note_dependency(str(design))
        rooms = ROOM.findall(design.read_text(encoding="utf-8"))
        lines = ["| Room | What is in it |", "| --- | --- |"]
        lines += [
            f"| {LINKED.sub('{py:mod}`', names)} | {content} |"
            for names, content in rooms
        ]
        place = nodes.container()
        self.state.nested_parse(StringList(lines, str(design)), 0, place)
        for table in place.findall(nodes.table):
            table["classes"].append("rooms")
        return place.children


def read_modules(app: Sphinx, config: Config) -> None:
    """Let Sphinx read the pages of modules, which the table of contents leaves out."""
    config.exclude_patterns = [
        name for name in config.exclude_patterns if not name.startswith(f"{PAGES}/")
    ]


def write_sources(app: Sphinx) -> None:
    """Write the sources of the pages of all modules.

    `autosummary` alone would look for modules only in changed sources. Once a module is
    gone, all sources are deleted first.
    """
    modules = {
        module.name
        for package in (sidm, ownrobot, companion)
        for module in pkgutil.walk_packages(package.__path__, f"{package.__name__}.")
    }
    modules |= {"sidm", "ownrobot", "companion"}
    sources = list((Path(app.srcdir) / PAGES).glob("*.rst"))
    if not modules.issuperset(path.stem for path in sources):
        while sources:  # the sources of other modules may name the one that is gone
            sources.pop().unlink()
    generate_autosummary_docs(
        [f"{PAGES}.md", *map(str, sources)], base_path=app.srcdir, app=app
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
    app.add_directive("rooms", Rooms)
    app.connect("config-inited", read_modules, priority=950)
    app.connect("builder-inited", write_sources)
    app.connect("html-page-context", break_title)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
