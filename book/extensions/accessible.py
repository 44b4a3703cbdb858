"""Sphinx extension: corrections of what other extensions write, for readers who do not see the page."""

from __future__ import annotations

import re

from sphinx.application import Sphinx

# One parameter a line stands in a description list without terms.
PARAMETERS = re.compile(r"<dl>\s*((?:<dd>(?:(?!</?d[dlt]\b).)*</dd>\s*)+)</dl>", re.DOTALL)


def parameter_list(found: re.Match[str]) -> str:
    """The same lines as a list."""
    return f'<ul class="parameters">{found[1].replace("<dd>", "<li>").replace("</dd>", "</li>")}</ul>'


def mend(app: Sphinx, page: str, template: str, context: dict, doctree: object) -> None:
    """References are announced as a list, but its entries have a role of their own: no list, then."""
    if "body" in context:
        body = context["body"].replace('<div role="list" class="citation', '<div class="citation')
        context["body"] = PARAMETERS.sub(parameter_list, body)


def setup(app: Sphinx) -> dict[str, object]:
    """Register with Sphinx."""
    app.connect("html-page-context", mend)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
