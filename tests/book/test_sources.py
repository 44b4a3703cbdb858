"""Names in the book's sources exist, and repeated facts agree."""

import argparse
import pkgutil
import re
import shlex
import tomllib
from importlib.metadata import version

import pytest
import yaml
from pages import ROOT, contents, source

import companion.__main__
import ownrobot.__main__
import sidm
from companion.pages.notebook import find_notebook, notebooks
from companion.pages.notebook_command import add_arguments
from companion.pages.parameters import inspect, merge_parameters, read_value

ROLE = re.compile(r"\{py:\w+\}`~?(?:[^`<]*<)?([\w.]+)>?`")
BASH = re.compile(r"^```bash\n(.*?)^```", re.MULTILINE | re.DOTALL)
COMMAND = re.compile(r"(?:\.venv/bin/)?(ownrobot|companion) (.+)")
PARSERS = {
    "ownrobot": ownrobot.__main__.build_parser,
    "companion": companion.__main__.build_parser,
}
PIN = re.compile(r"^([A-Za-z0-9_.-]+)==([^\s#;]+)(?:; [^#]+?)?(?:\s+# (.+))?$")


@pytest.mark.parametrize("name", contents())
def test_what_a_page_includes_is_in_the_copy_that_is_rendered(name):
    """`make book` renders a copy of the paths in the Makefile's `cp` lines."""
    copied = [
        word
        for line in re.findall(
            r"^\tcp (?:-R )?(.+)", (ROOT / "Makefile").read_text(), re.MULTILINE
        )
        for word in line.split()[:-1]
    ]
    for included in re.findall(r"\{(?:literal)?include\} (\S+)", source(name)):
        path = (ROOT / name).parent.joinpath(included).resolve().relative_to(ROOT)
        assert any(
            one.match(word) for one in (path, *path.parents) for word in copied
        ), included


def pins(name: str) -> dict[str, tuple[str, str | None]]:
    lines = [
        line
        for line in (ROOT / name).read_text().splitlines()
        if line and line[0] not in "#-"
    ]
    matches = [PIN.match(line) for line in lines]
    loose = [line for line, m in zip(lines, matches, strict=True) if not m]
    assert not loose, f"{name}: not exact: {loose}"
    return {m[1].lower(): (m[2], m[3]) for m in matches if m}


@pytest.mark.parametrize("name", contents())
def test_a_page_of_the_contents_exists_and_is_named_with_hyphens(name):
    assert (ROOT / f"{name}.md").is_file() or (ROOT / f"{name}.ipynb").is_file()
    assert "_" not in name and " " not in name


@pytest.mark.parametrize("name", contents())
def test_what_a_page_refers_to_in_the_package_can_be_imported(name):
    for target in ROLE.findall(source(name)):
        pkgutil.resolve_name(target)


def commands() -> list[str]:
    """Commands of the packages that the pages and the README show without output.

    Other tests run the commands that are shown with their output, and those for a
    system called soft, which readers add.
    """
    texts = [*map(source, contents()), (ROOT / "README.md").read_text(encoding="utf-8")]
    blocks = (
        block.replace("\\\n", " ") for text in texts for block in BASH.findall(text)
    )
    return [
        line
        for block in blocks
        for line in block.splitlines()
        if COMMAND.match(line) and "soft" not in line
    ]


def words_of(command: str) -> list[str]:
    match = COMMAND.match(command)
    assert match is not None
    return shlex.split(match[2], comments=True)


@pytest.mark.parametrize(
    "command", [one for one in commands() if words_of(one)[0] != "notebook"]
)
def test_a_command_could_be_run(command, monkeypatch):
    """Every command parses, but for two kinds that need another machine.

    These are commands for a GPU and with a method that the reader has written.
    """
    monkeypatch.chdir(ROOT)
    words = words_of(command)
    if {"cuda", "half_frozen"} & set(words):
        known = "preset figure device bundle method system minutes".split()
        assert set(words[1::2]) <= {f"--{name}" for name in known}
        return
    if words[-1] == "--help":
        words = words[:-1]
    PARSERS[command.removeprefix(".venv/bin/").split()[0]]().parse_args(words)


@pytest.mark.parametrize(
    "command", [one for one in commands() if words_of(one)[0] == "notebook"]
)
def test_a_command_for_a_notebook_could_be_run(command, monkeypatch):
    monkeypatch.chdir(ROOT)
    parser = argparse.ArgumentParser()
    add_arguments(parser)
    given = parser.parse_args(words_of(command)[1:])
    path = find_notebook(given.notebook)
    kinds = {name: parameter.kind for name, parameter in inspect(path).items()}
    values = {
        name: read_value(text, kinds.get(name), name) for name, text in given.parameter
    }
    assert merge_parameters(path, values, given.file).keys() >= values.keys()


def test_one_version_everywhere():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    latest = re.search(r"^## (\d\S*)", source("CHANGELOG"), re.MULTILINE)
    assert latest is not None
    assert {project["version"], citation["version"], latest[1], sidm.__version__} == {
        sidm.__version__
    }


def test_requirements_are_exact_and_say_why():
    assert [
        name for name, (_, why) in pins("requirements.txt").items() if not why
    ] == []


def test_what_runs_here_is_what_is_pinned():
    wanted = pins("requirements.txt")
    assert {
        name: v for name, (v, _) in wanted.items() if version(name).split("+")[0] != v
    } == {}


def test_constraints_name_no_place():
    text = (ROOT / "requirements.txt").read_text() + (
        ROOT / "constraints.txt"
    ).read_text()
    assert "//" not in text and " @ " not in text
    assert set(pins("constraints.txt")) & set(pins("requirements.txt")) == set()


def test_nothing_runs_while_the_book_is_rendered():
    config = yaml.safe_load((ROOT / "_config.yml").read_text())
    assert config["execute"]["execute_notebooks"] == "off"


def test_presets_name_parameters_that_some_notebook_has():
    known = {name for path in notebooks(ROOT) for name in inspect(path)}
    for path in (ROOT / "params").glob("*.yaml"):
        assert set(yaml.safe_load(path.read_text())) <= known, path
