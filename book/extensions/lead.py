"""Sphinx extension: a notebook's answer stands right below its title.

A notebook computes before it answers. Folded cells of parameters and code that show
nothing else move from there to the end of the page's first part, below the figure.
"""

from __future__ import annotations

from docutils import nodes
from sphinx.application import Sphinx


def is_folded(node: nodes.Node) -> bool:
    """Whether a node is a cell whose code is folded and that has no output."""
    return (
        isinstance(node, nodes.container)
        and node.get("nb_element") == "cell_code"
        and "tag_hide-input" in node["classes"]
        and not any(
            child.get("nb_element") == "cell_code_output"
            for child in node.children
            if isinstance(child, nodes.container)
        )
    )


def move_folded(app: Sphinx, doctree: nodes.document) -> None:
    """Move the folded cells of a page's first part behind the rest of it."""
    page = next(iter(doctree.findall(nodes.section)), None)
    if page is None:
        return
    sections = [n for n, child in enumerate(page) if isinstance(child, nodes.section)]
    end = sections[0] if sections else len(page)
    first = page.children[:end]
    folded = [node for node in first if is_folded(node)]
    page[:end] = [node for node in first if node not in folded] + folded


def setup(app: Sphinx) -> dict[str, object]:
    """Register with Sphinx."""
    app.connect("doctree-read", move_folded)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
