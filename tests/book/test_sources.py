"""Names in the book's sources exist, and repeated facts agree."""

import pkgutil
import re
import shlex
import tomllib
from importlib.metadata import version

import pytest
import yaml
from pages import ROLE, ROOT, contents, source

import companion.__main__
import ownrobot.__main__
import sidm
from companion.pages.notebook import find_notebook, notebooks
from companion.pages.notebook_command import _run_of
from companion.pages.parameters import inspect

BASH = re.compile(r"^```bash\n(.*?)^```", re.MULTILINE | re.DOTALL)
COMMAND = re.compile(r"(?:\.venv/bin/)?(ownrobot|companion) (.+)")
PARSERS = {
    "ownrobot": ownrobot.__main__.build_parser,
    "companion": companion.__main__.build_parser,
}
PIN = re.compile(r"^([A-Za-z0-9_.-]+)==([^\s#;]+)(?:; [^#]+?)?(?:\s+# (.+))?$")


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
def test_what_a_page_names_is_there(name):
    """Itself, what it includes in the copy that `make book` renders, Python's names."""
    assert (ROOT / f"{name}.md").is_file() or (ROOT / f"{name}.ipynb").is_file()
    assert "_" not in name and " " not in name
    makefile = (ROOT / "Makefile").read_text()
    lines = re.findall(r"^\tcp (?:-R )?(.+)", makefile, re.MULTILINE)
    copied = [word for line in lines for word in line.split()[:-1]]
    for included in re.findall(r"\{(?:literal)?include\} (\S+)", source(name)):
        path = (ROOT / name).parent.joinpath(included).resolve().relative_to(ROOT)
        places = path, *path.parents
        assert any(one.match(word) for one in places for word in copied), included
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


@pytest.mark.parametrize("command", commands())
def test_a_command_could_be_run(command, monkeypatch):
    """Every command parses, but for two kinds that need another machine.

    These are commands for a GPU and with a method that the reader has written.
    """
    monkeypatch.chdir(ROOT)
    program, words = command.split()[0], words_of(command)
    if {"cuda", "half_frozen"} & set(words):
        known = "preset figure device bundle methods system results".split()
        assert set(words[1::2]) <= {f"--{name}" for name in known}
        return
    if words[-1] == "--help":
        words = words[:-1]
    parsed = PARSERS[program.removeprefix(".venv/bin/")]().parse_args(words)
    if words[0] == "notebook":
        values = _run_of(find_notebook(parsed.notebook), parsed).values
        assert values.keys() >= dict(parsed.parameter).keys()


def test_one_version_everywhere():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    latest = re.search(r"^## (\d\S*)", source("CHANGELOG"), re.MULTILINE)
    assert latest is not None
    assert {project["version"], citation["version"], latest[1], sidm.__version__} == {
        sidm.__version__
    }


def test_what_runs_here_is_what_is_pinned():
    """Requirements are exact and say why; constraints name no place."""
    wanted, constraints = pins("requirements.txt"), pins("constraints.txt")
    assert [name for name, (_, why) in wanted.items() if not why] == []
    found = {name: version(name).split("+")[0] for name in wanted}
    assert found == {name: number for name, (number, _) in wanted.items()}
    assert set(constraints) & set(wanted) == set()
    for name in ("requirements.txt", "constraints.txt"):
        text = (ROOT / name).read_text()
        assert "//" not in text and " @ " not in text


def test_nothing_runs_while_the_book_is_rendered():
    config = yaml.safe_load((ROOT / "_config.yml").read_text())
    assert config["execute"]["execute_notebooks"] == "off"


def test_presets_name_parameters_that_some_notebook_has():
    known = {name for path in notebooks(ROOT) for name in inspect(path)}
    for path in (ROOT / "params").glob("*.yaml"):
        assert set(yaml.safe_load(path.read_text())) <= known, path
