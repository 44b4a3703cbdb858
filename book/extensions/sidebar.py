"""Sphinx extension: make the contents in the sidebar from the pages' titles alone.

For every page, Sphinx copies the headings of all pages, thousands of them from the
reference, and then removes all but the titles. This takes a quarter of the time of
rendering. The modules are a tree of short names, which only the pages of the reference
show.
"""

from __future__ import annotations

from docutils import nodes
from sphinx import addnodes
from sphinx.application import Sphinx

LIST = "book/extending"  # lists the modules
MODULES = "book/api/"


def titles_of(
    name: str, headings: nodes.bullet_list, with_pages: bool = True
) -> nodes.bullet_list:
    """Headings of a page without those below its title.

    Those below it stay if they list other pages and `with_pages` is set.
    """
    titles = headings.deepcopy()
    for entry in titles.children:
        if len(entry) > 1 and not (with_pages and any(entry.findall(addnodes.toctree))):
            entry.pop(1)
    if name.startswith(MODULES):
        title = next(titles.findall(nodes.reference))
        title.children = [nodes.Text(title.astext().rpartition(".")[2])]
    return titles


def shorten(
    app: Sphinx, page: str, template: str, context: dict, doctree: object
) -> None:
    """Give Sphinx only the titles of pages where it makes a list of titles alone."""
    make = context["toctree"]

    def toctree(**options: object) -> str:
        if not options.get("titles_only"):
            return make(**options)
        headings = app.env.tocs
        app.env.tocs = titles if page.startswith((LIST, MODULES)) else titles | closed
        try:
            return make(**options)
        finally:
            app.env.tocs = headings

    if not hasattr(app.builder, "titles"):
        app.builder.titles = {
            name: titles_of(name, headings) for name, headings in app.env.tocs.items()
        }
    titles = app.builder.titles
    closed = {LIST: titles_of(LIST, app.env.tocs[LIST], with_pages=False)}
    context["toctree"] = toctree


def setup(app: Sphinx) -> dict[str, object]:
    """Register with Sphinx, before the theme asks for its sidebar."""
    app.connect("html-page-context", shorten, priority=100)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
