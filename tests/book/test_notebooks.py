"""Notebooks: what their cells, outputs and words have, and runs with other sizes.

With its own parameters every notebook is run by nbval.
"""

import re
from collections.abc import Iterator
from typing import Any

import nbformat
import pytest
from pages import ROOT, contents

from companion.__main__ import main
from companion.pages.notebook import notebooks
from companion.pages.parameters import inspect

NOTEBOOKS = [pytest.param(path, id=path.stem) for path in notebooks(ROOT)]
PROVENANCE = 'class="provenance"'
#: groups: name of the output, notebook
GLUED = re.compile(r"^```\{glue\} (\S+)\n:doc: \.\./(\S+)$", re.MULTILINE)
TAKING = [
    name
    for name in contents()
    if name.startswith("book/") and GLUED.search((ROOT / f"{name}.md").read_text())
]
#: cells with tables of settings, which are not results
SETTINGS = {"04-70", "21-10", "21-11", "21-12"}


def glued(output: Any) -> bool:
    """Whether an output is kept for other pages and not shown in its notebook."""
    return bool(output.get("metadata", {}).get("scrapbook", {}).get("mime_prefix"))


def is_picture(output: Any) -> bool:
    """Whether an output is a picture, shown here or kept for other pages."""
    return any(kind.startswith("image/") for kind in output.get("data", {}))


def faults(cell: Any) -> Iterator[str]:
    """What is wrong with a cell, in whichever notebook it stands.

    Text with numbers, and what is kept for other pages, is output that nbval compares;
    no number depends on MyST-NB alone, so Jupyter and nbconvert show it, too.
    """
    tags, about = cell.metadata.get("tags", []), cell.metadata.get("mystnb", {})
    outputs = cell.get("outputs", [])
    shown = [output for output in outputs if not glued(output)]
    if "{glue" in cell.source:
        yield "a number that MyST-NB alone shows"
    if cell.cell_type != "code" or not cell.source:
        return
    if cell.execution_count is None:
        yield "was never run"
    if any(output.output_type == "error" for output in outputs):
        yield "an error"
    if cell.source.startswith("%%text") or len(shown) < len(outputs):
        if "nbval-check-output" not in tags:
            yield "nbval does not compare it"
    if any(map(is_picture, shown)) and not about.get("image", {}).get("alt"):
        yield "a picture without words"
    if "hide-input" in tags or "parameters" in tags:
        words = "parameters" if "parameters" in tags else "code"
        prompts = about.get("code_prompt_show"), about.get("code_prompt_hide")
        if prompts != (f"Show: {words}", f"Hide: {words}"):
            yield "it is folded with other words"


@pytest.mark.parametrize("path", NOTEBOOKS)
def test_its_cells_are_whole(path):
    notebook = nbformat.read(path, as_version=4)
    wrong = {cell.id: [*faults(cell)] for cell in notebook.cells}
    assert {name: found for name, found in wrong.items() if found} == {}
    tags = [cell.metadata.get("tags", []) for cell in notebook.cells]
    assert sum("parameters" in some for some in tags) == 1
    assert all(parameter.help for parameter in inspect(path).values())
    assert "widgets" not in notebook.metadata, "no page shows a widget's state"
    text = path.read_text(encoding="utf-8")
    assert '"papermill": {' not in text, "refresh it with make notebooks"


@pytest.mark.parametrize("path", NOTEBOOKS)
def test_its_results_say_where_they_come_from(path):
    """A line of provenance follows tables and pictures.

    It stands in their section, or at the end of a page that makes its own results.
    """
    cells = nbformat.read(path, as_version=4).cells
    makes_its_own = any("made_here(" in cell.source for cell in cells)
    waiting, lacking = [], []
    for cell in cells:
        if cell.cell_type == "markdown" and cell.source.startswith("## "):
            if not makes_its_own:
                lacking += waiting
                waiting = []
        shown = [o for o in cell.get("outputs", []) if not glued(o)]
        texts = [str(text) for o in shown for text in o.get("data", {}).values()]
        if any(PROVENANCE in text for text in texts):
            waiting = []
        elif any(map(is_picture, shown)) or any("| --- |" in text for text in texts):
            waiting += [cell.id] if cell.id not in SETTINGS else []
    assert lacking + waiting == []


@pytest.mark.parametrize("name", TAKING)
def test_results_that_a_page_takes_over_say_where_they_come_from(name):
    """A section that shows results of notebooks also shows a line of provenance."""
    text = (ROOT / f"{name}.md").read_text(encoding="utf-8")
    for section in re.split(r"^(?=#+ )", text, flags=re.MULTILINE):
        shown = [kept(path, key) for key, path in GLUED.findall(section)]
        assert not shown or any(PROVENANCE in one for one in shown), section[:80]


def kept(path: str, key: str) -> str:
    """Output that a notebook keeps under a name for other pages."""
    cells = nbformat.read(ROOT / path, as_version=4).cells
    outputs = [o for cell in cells for o in cell.get("outputs", []) if glued(o)]
    return next(str(o.data) for o in outputs if o.metadata["scrapbook"]["name"] == key)


@pytest.mark.more
@pytest.mark.parametrize("path", NOTEBOOKS)
def test_it_runs_with_the_smoke_preset(project, tmp_path, monkeypatch, capsys, path):
    output = tmp_path / path.name
    monkeypatch.chdir(project)
    status = main(["notebook", path.stem, str(output), "-f", "params/smoke.yaml"])
    assert status == 0, capsys.readouterr().err[-3000:]
    assert output.is_file()
