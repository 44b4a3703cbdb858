"""Sphinx extension: corrections of what other extensions write, for readers who do not see the page."""

from __future__ import annotations

import re

from bs4 import BeautifulSoup
from sphinx.application import Sphinx

# One parameter a line stands in a description list without terms.
PARAMETERS = re.compile(
    r"<dl>\s*((?:<dd>(?:(?!</?d[dlt]\b).)*</dd>\s*)+)</dl>", re.DOTALL
)


def parameter_list(found: re.Match[str]) -> str:
    """The same lines as a list."""
    return f'<ul class="parameters">{found[1].replace("<dd>", "<li>").replace("</dd>", "</li>")}</ul>'


def mend(app: Sphinx, page: str, template: str, context: dict, doctree: object) -> None:
    """References are announced as a list, but its entries have a role of their own: no list, then."""
    if "body" in context:
        body = context["body"].replace(
            '<div role="list" class="citation', '<div class="citation'
        )
        context["body"] = PARAMETERS.sub(parameter_list, body)


def name_toggles(
    app: Sphinx, page: str, template: str, context: dict, doctree: object
) -> None:
    """What unfolds the pages below one in the sidebar says whose they are."""
    make = context["generate_toctree_html"]

    def named(*words: str, **options: object) -> BeautifulSoup:
        made = make(*words, **options)
        for toggle in made.select("li > details > summary"):
            toggle["aria-label"] = (
                f"Pages below {toggle.find_parent('li').a.get_text(strip=True)}"
            )
        return made

    context["generate_toctree_html"] = named


def setup(app: Sphinx) -> dict[str, object]:
    """Register with Sphinx."""
    app.connect("html-page-context", mend)
    # the theme makes the sidebar before
    app.connect("html-page-context", name_toggles, priority=900)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
