"""Tables of every parameter: of each chapter, and of the presets."""

from __future__ import annotations

from collections.abc import Sequence

import nbformat
import yaml

from companion.pages.figure3_tables import sizes
from companion.pages.markdown import markdown_table, table_markdown
from companion.pages.notebook import find_notebook, notebooks, project_root
from companion.pages.parameters import inspect
from companion.presets import PRESETS
from sidm.systems import PAPER_SYSTEMS

HEAD = ("parameter", "type", "value", "what it is")


def chapters_text(chapters: Sequence[str] = ()) -> str:
    """A table of the parameters of each notebook, or of those that are named."""
    parts = []
    for path in [find_notebook(name) for name in chapters] or notebooks():
        lines = [
            (f"`{p.name}`", f"`{p.kind_text}`", f"`{p.default}`", p.help)
            for p in inspect(path).values()
        ]
        first_cell = nbformat.read(path, as_version=4).cells[0].source
        heading = first_cell.splitlines()[0].lstrip("# ")
        title = f"**[{heading}]({path.name})**, `{path.stem}`"
        parts.append(f"{title}\n\n{markdown_table(HEAD, lines)}")
    return "\n\n".join(parts)


def presets_text() -> str:
    """A table of the presets' main sizes, and one of what files of `params/` set."""
    return f"{table_markdown(sizes(PRESETS, PAPER_SYSTEMS))}\n\n{_files()}"


def _files() -> str:
    """A column for each file; a row for each name that a chapter knows."""
    files = sorted(project_root().glob("params/*.yaml"))
    values = {path.stem: yaml.safe_load(path.read_text()) for path in files}
    known = {name for path in notebooks() for name in inspect(path)}
    names = sorted(known & {name for given in values.values() for name in given})
    lines = [
        (f"`{name}`", *(f"`{v[name]}`" if name in v else "" for v in values.values()))
        for name in names
    ]
    return markdown_table(["parameter", *(f"`{name}.yaml`" for name in values)], lines)
