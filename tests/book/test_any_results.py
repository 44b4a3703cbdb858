"""Notebooks run on any results: none, few, other sizes, a system of one's own."""

import os
import re
import shlex
import shutil
from pathlib import Path

import nbformat
import pytest
from pages import ROOT
from places import copy_tree, run_python

from companion import Results, Study, run
from companion.__main__ import main
from companion.pages.notebook import notebooks
from companion.pages.notebook_command import Run, execute
from companion.pages.parameters import inspect

WITH_RESULTS = [
    pytest.param(path, id=path.stem)
    for path in notebooks(ROOT)
    if "results" in inspect(path)
]
PAGE = (ROOT / "book" / "extending.md").read_text(encoding="utf-8")
OTHER_SIZES = "smoke seeds=2 pixels=12"


def texts(path: Path) -> list[str]:
    """What an executed notebook shows as text, in order."""
    return [
        output.data.get("text/markdown", output.data.get("text/html", ""))
        for cell in nbformat.read(path, as_version=4).cells
        for output in cell.get("outputs", [])
        if "data" in output
    ]


@pytest.fixture(scope="session")
def few_results(tmp_path_factory, motion) -> dict[str, Path]:
    """Folders of results: none, one stored trial, and trials of other sizes."""
    folder = tmp_path_factory.mktemp("results")
    study, stored = Study("study"), Results(ROOT / "results")
    (row,) = stored.stored([study.trial("system1", "sidm", 5.0)])
    Results(folder / "one").put(row)
    other = Study(OTHER_SIZES)
    trials = other.figure3("system1") + other.references("system1")
    run(trials, workers=1, data=motion, results=folder / "other", progress=False)
    (folder / "empty").mkdir()
    return {name: folder / name for name in ("empty", "one", "other")}


@pytest.mark.more
@pytest.mark.parametrize("kind", ["empty", "one", "other"])
@pytest.mark.parametrize("path", WITH_RESULTS)
def test_a_notebook_runs_on_them(few_results, motion, tmp_path, path, kind):
    values = {"results": str(few_results[kind])}
    if kind == "other":
        values |= {"preset": OTHER_SIZES, "data": str(motion)}
    values = {name: value for name, value in values.items() if name in inspect(path)}
    execute([Run(path, tmp_path / path.name, values)])
    banner, *shown = texts(tmp_path / path.name)
    assert banner.startswith("> **Run with `") and "results = " in banner
    assert kind == "other" or any(
        words in text
        for text in shown
        for words in ("No trials stored", "missing", "not run", "are stored")
    )
    assert not any(re.search(r"\bnan\b", text) for text in shown)


def test_figure_3_shows_what_is_there(few_results, motion, tmp_path, capsys):
    """The chapter draws a few trials of changed sizes, and counts the missing ones."""
    output, results = tmp_path / "mine.ipynb", str(few_results["other"])
    words = ["-p", "preset", OTHER_SIZES, "-p", "results", results]
    words += ["-p", "data", str(motion)]
    assert main(["notebook", "figure3", str(output), *words]) == 0, capsys.readouterr()
    shown = "\n".join(texts(output))
    assert "`preset = smoke seeds=2 pixels=12`" in shown
    assert re.search(r"of system 2.*companion run --preset '?smoke seeds=2", shown)


@pytest.mark.more
def test_the_page_on_extending_works_to_the_letter(project, tmp_path):
    """A copy gets the page's system; commands of the page and other chapters run."""
    copy = tmp_path / "project"
    copy_tree(project, copy)
    source = copy / "sidm" / "systems.py"
    text = source.read_text(encoding="utf-8")
    (code,) = re.findall(r"^```python\n(SYSTEMS.*?)```", PAGE, re.MULTILINE | re.DOTALL)
    paper = "#: The pairs whose results the book shows."
    source.unlink()  # a link to the project's
    source.write_text(text.replace(paper, f"{code}\n{paper}"), encoding="utf-8")
    section = PAGE[PAGE.index("## Add a system") : PAGE.index("## Add a method")]
    whole_lines = section.replace("\\\n", "")
    commands = re.findall(r"^companion .*", whole_lines, re.MULTILINE)
    assert len(commands) == 7
    own = "-p systems [soft] -p preset smoke -p results _build/soft"
    for name in ("p-expert-and-phases", "latent-space", "choices"):
        commands.append(f"companion notebook {name} _build/{name}.ipynb {own}")
    commands.append(commands[2])  # again, after all trials were run

    def said(command):
        environment = os.environ | {"PYTHONPATH": str(copy)}
        done = run_python("-m", *shlex.split(command), cwd=copy, env=environment)
        assert done.returncode == 0, f"{command}\n{done.stderr[-2000:]}"
        return done.stdout

    assert "missing: 0" in [said(command) for command in commands][-1]
    shutil.rmtree(copy)
