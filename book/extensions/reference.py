"""Sphinx extension: the reference's pages, one for each module, and the table of rooms that leads to them.

`autosummary` finds the modules and writes the sources of their pages into book/api,
which git ignores.
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
import sidm

PAGES = "book/api"
DESIGN = "book/design.md"
ROOM = re.compile(r"^\| (`(?:sidm|companion)\..+?) \| (.+?) \| .*\|$", re.MULTILINE)
LINKED = re.compile(r"`(?=(?:sidm|companion)\.[a-z])")  # `sidm.__main__` has no page
TITLE = re.compile(r"(?<=<h1>)[\w.]+")


class Rooms(SphinxDirective):
    """The rooms of both packages, linked, in the order of the page on its design."""

    def run(self) -> list[nodes.Node]:
        """The table, made from that page's."""
        design = Path(self.env.srcdir) / DESIGN
        self.env.note_dependency(str(design))
        rooms = ROOM.findall(design.read_text(encoding="utf-8"))
        lines = ["| Room | What is in it |", "| --- | --- |"]
        lines += [
            f"| {re.sub(LINKED, '{py:mod}`', names)} | {what} |"
            for names, what in rooms
        ]
        place = nodes.container()
        self.state.nested_parse(StringList(lines, str(design)), 0, place)
        for table in place.findall(nodes.table):
            table["classes"].append("rooms")
        return place.children


def read_modules(app: Sphinx, config: Config) -> None:
    """Let the pages of modules be read, which the table of contents does not list."""
    config.exclude_patterns = [
        name for name in config.exclude_patterns if not name.startswith(f"{PAGES}/")
    ]


def write_sources(app: Sphinx) -> None:
    """Look for modules in all sources, as `autosummary` would in those that change; none outlives its module."""
    modules = {
        module.name
        for package in (sidm, companion)
        for module in pkgutil.walk_packages(package.__path__, f"{package.__name__}.")
    }
    modules |= {"sidm", "companion"}
    sources = list((Path(app.srcdir) / PAGES).glob("*.rst"))
    if not modules.issuperset(path.stem for path in sources):
        while sources:  # others may name what is gone
            sources.pop().unlink()
    generate_autosummary_docs(
        [f"{PAGES}.md", *map(str, sources)], base_path=app.srcdir, app=app
    )


def break_title(
    app: Sphinx, page: str, template: str, context: dict, doctree: object
) -> None:
    """The name of a module goes on in another line after a dot, not in the middle of a word."""
    if page.startswith(f"{PAGES}/") and context.get("body"):
        context["body"] = TITLE.sub(
            lambda name: name[0].replace(".", ".<wbr>"), context["body"], count=1
        )


def setup(app: Sphinx) -> dict[str, object]:
    """Register with Sphinx; what leaves files out comes before."""
    plain = autosummary._import_by_name

    def modules_first(
        name: str, *words: bool, **options: bool
    ) -> tuple[object, object, str]:
        """A package may hand on a function that is named as its module, which is then meant."""
        thing, parent, place = plain(name, *words, **options)
        return sys.modules.get(name, thing), parent, place

    autosummary._import_by_name = modules_first
    app.add_directive("rooms", Rooms)
    app.connect("config-inited", read_modules, priority=950)
    app.connect("builder-inited", write_sources)
    app.connect("html-page-context", break_title)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
