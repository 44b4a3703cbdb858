"""Sphinx extension: correct the pages for readers who use a screen reader."""

from __future__ import annotations

import re

from bs4 import BeautifulSoup
from sphinx.application import Sphinx

# a description list without terms, which has one parameter a line
PARAMETERS = re.compile(
    r"<dl>\s*((?:<dd>(?:(?!</?d[dlt]\b).)*</dd>\s*)+)</dl>", re.DOTALL
)


def parameter_list(match: re.Match[str]) -> str:
    """HTML of an ordinary list with the parameters of the description list."""
    items = match[1].replace("<dd>", "<li>").replace("</dd>", "</li>")
    return f'<ul class="parameters">{items}</ul>'


def mend(app: Sphinx, page: str, template: str, context: dict, doctree: object) -> None:
    """Correct the lists of parameters and of references.

    References are marked as a list, but their entries have another role than entries of
    a list; so the mark is removed.
    """
    if "body" in context:
        listed, plain = '<div role="list" class="citation', '<div class="citation'
        body = context["body"].replace(listed, plain)
        context["body"] = PARAMETERS.sub(parameter_list, body)


def name_toggles(
    app: Sphinx, page: str, template: str, context: dict, doctree: object
) -> None:
    """Name the toggles of the sidebar after the page whose subpages they unfold."""
    make = context["generate_toctree_html"]

    def make_named(*args: str, **options: object) -> BeautifulSoup:
        sidebar = make(*args, **options)
        for toggle in sidebar.select("li > details > summary"):
            title = toggle.find_parent("li").a.get_text(strip=True)
            toggle["aria-label"] = f"Pages below {title}"
        return sidebar

    context["generate_toctree_html"] = make_named


def setup(app: Sphinx) -> dict[str, object]:
    """Register with Sphinx."""
    app.connect("html-page-context", mend)
    # after the theme, which provides the function that makes the sidebar
    app.connect("html-page-context", name_toggles, priority=900)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
