"""Notebooks: what their cells, outputs and words have, and runs with other sizes.

With its own parameters every notebook is run by nbval.
"""

import re

import nbformat
import pytest
from pages import ROOT, contents

from companion.__main__ import main
from companion.pages.notebook import notebooks
from companion.pages.parameters import inspect

NOTEBOOKS = [pytest.param(path, id=path.stem) for path in notebooks(ROOT)]
#: groups: name of the output, notebook
GLUED = re.compile(r"^```\{glue\} (\S+)\n:doc: \.\./(\S+)$", re.MULTILINE)
TAKING = [
    name
    for name in contents()
    if name.startswith("book/") and GLUED.search((ROOT / f"{name}.md").read_text())
]


def glued(output) -> bool:
    """Whether an output is kept for other pages and not shown in its notebook."""
    return bool(output.get("metadata", {}).get("scrapbook", {}).get("mime_prefix"))


@pytest.mark.more
@pytest.mark.parametrize("path", NOTEBOOKS)
def test_it_runs_with_the_smoke_preset(project, tmp_path, monkeypatch, capsys, path):
    output = tmp_path / path.name
    monkeypatch.chdir(project)
    status = main(["notebook", path.stem, str(output), "-f", "params/smoke.yaml"])
    assert status == 0, capsys.readouterr().err[-3000:]
    assert output.is_file()


@pytest.mark.parametrize("path", NOTEBOOKS)
def test_its_parameters_say_what_they_are(path):
    cells = nbformat.read(path, as_version=4).cells
    assert sum("parameters" in cell.metadata.get("tags", []) for cell in cells) == 1
    assert [
        name for name, parameter in inspect(path).items() if not parameter.help
    ] == []


@pytest.mark.parametrize("path", NOTEBOOKS)
def test_its_committed_outputs_are_whole(path):
    cells = [
        cell
        for cell in nbformat.read(path, as_version=4).cells
        if cell.cell_type == "code" and cell.source
    ]
    assert [cell.source for cell in cells if cell.execution_count is None] == [], (
        "cells that were never run"
    )
    errors = [
        output
        for cell in cells
        for output in cell.outputs
        if output.output_type == "error"
    ]
    assert errors == []
    assert "widgets" not in nbformat.read(path, as_version=4).metadata, (
        "no page shows a widget's state"
    )
    assert '"papermill": {' not in path.read_text(encoding="utf-8"), (
        "refresh it with make notebooks"
    )


@pytest.mark.parametrize("path", NOTEBOOKS)
def test_every_number_in_its_text_is_compared(path):
    """Text with numbers, and what is kept for other pages, is output that nbval sees.

    No number depends on MyST-NB alone, so Jupyter and nbconvert show it, too.
    """
    open_cells, roles = [], []
    for cell in nbformat.read(path, as_version=4).cells:
        shown = cell.source.startswith("%%text") or any(
            glued(output) for output in cell.get("outputs", [])
        )
        if shown and "nbval-check-output" not in cell.metadata.get("tags", []):
            open_cells.append(cell.id)
        if "{glue" in cell.source:
            roles.append(cell.id)
    assert (open_cells, roles) == ([], [])


@pytest.mark.parametrize("path", NOTEBOOKS)
def test_its_pictures_have_words(path):
    wordless = []
    for cell in nbformat.read(path, as_version=4).cells:
        drawn = [
            o
            for o in cell.get("outputs", [])
            if any(kind.startswith("image/") for kind in o.get("data", {}))
        ]
        if any(not glued(o) for o in drawn) and not cell.metadata.get("mystnb", {}).get(
            "image", {}
        ).get("alt"):
            wordless.append(cell.source.splitlines()[0])
    assert wordless == []


#: cells with tables of settings, which are not results
SETTINGS = {"04-70", "21-10", "21-11", "21-12"}


@pytest.mark.parametrize("path", NOTEBOOKS)
def test_its_results_say_where_they_come_from(path):
    """A line of provenance follows tables and pictures.

    It stands in their section, or at the end of a page that makes its own results.
    """
    cells = nbformat.read(path, as_version=4).cells
    makes_its_own = any("made_here(" in cell.source for cell in cells)
    open_results = []
    lacking = []
    for cell in cells:
        if (
            cell.cell_type == "markdown"
            and cell.source.startswith("## ")
            and not makes_its_own
        ):
            lacking += open_results
            open_results = []
        shown = [o.get("data", {}) for o in cell.get("outputs", []) if not glued(o)]
        texts = [str(text) for data in shown for text in data.values()]
        pictures = any(kind.startswith("image/") for data in shown for kind in data)
        if any('class="provenance"' in text for text in texts):
            open_results = []
        elif (
            pictures or any("| --- |" in text for text in texts)
        ) and cell.id not in SETTINGS:
            open_results.append(cell.id)
    assert lacking + open_results == []


@pytest.mark.parametrize("name", TAKING)
def test_results_that_a_page_takes_over_say_where_they_come_from(name):
    """A section that shows results of notebooks also shows a line of provenance."""
    lacking = []
    for section in re.split(
        r"^(?=#+ )",
        (ROOT / f"{name}.md").read_text(encoding="utf-8"),
        flags=re.MULTILINE,
    ):
        shown = [kept(path, key) for key, path in GLUED.findall(section)]
        if shown and not any('class="provenance"' in text for text in shown):
            lacking.append(section.splitlines()[0])
    assert lacking == []


def kept(path: str, key: str) -> str:
    """Output that a notebook keeps under a name for other pages."""
    cells = nbformat.read(ROOT / path, as_version=4).cells
    outputs = [
        output for cell in cells for output in cell.get("outputs", []) if glued(output)
    ]
    return next(str(o.data) for o in outputs if o.metadata["scrapbook"]["name"] == key)


@pytest.mark.parametrize("path", NOTEBOOKS)
def test_code_is_folded_with_the_same_words(path):
    for cell in nbformat.read(path, as_version=4).cells:
        tags = cell.metadata.get("tags", [])
        if "parameters" in tags:
            assert "hide-input" in tags
        if "hide-input" in tags:
            words = "parameters" if "parameters" in tags else "code"
            assert cell.metadata.mystnb.code_prompt_show == f"Show: {words}"
            assert cell.metadata.mystnb.code_prompt_hide == f"Hide: {words}"
