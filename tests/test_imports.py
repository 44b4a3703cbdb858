"""Imports go one way, and only the simulation needs PyBullet."""

import ast
import graphlib
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGES = ("sidm", "ownrobot", "companion")  # each uses those before it


def rooms() -> list[list[str]]:
    """Rooms in the table of the book's page on extending, row by row."""
    lines = (ROOT / "book" / "extending.md").read_text(encoding="utf-8").splitlines()
    names = [
        re.findall(r"`((?:sidm|ownrobot|companion)\.[\w.]+)`", line.split("|")[1])
        for line in lines
        if line.startswith(("| `", "| {py:mod}`"))
    ]
    return [row for row in names if row]


ROOMS = rooms()
ROW = {room: number for number, row in enumerate(ROOMS) for room in row}

PYBULLET = {"pybullet", "pybullet_data", "pybullet_utils"}
WITHOUT_TORCH = (
    "sidm.terrain",
    "sidm.simulation",
    "sidm.drives",
    "sidm.shards",
    "sidm.settings",
    "ownrobot.recordings",
)


def modules() -> dict[str, Path]:
    """File of every module of the packages, by its dotted name."""
    files = {}
    for path in sorted(
        path for name in PACKAGES for path in (ROOT / name).rglob("*.py")
    ):
        parts = path.relative_to(ROOT).with_suffix("").parts
        files[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return files


MODULES = modules()
#: modules without the packages, which re-export names of their rooms
INSIDE = [name for name in MODULES if name not in PACKAGES]


def imported(
    name: str, top_level_only: bool = False, annotations: bool = True
) -> Iterator[str]:
    """Dotted names of what a module imports.

    `from a import b` gives a.b where that is a module.
    """
    text = MODULES[name].read_text(encoding="utf-8")
    if not annotations:  # what a type checker alone reads
        text = text.replace("if TYPE_CHECKING:\n", "def types():\n")
    tree = ast.parse(text)
    if not annotations:
        tree.body = [one for one in tree.body if getattr(one, "name", "") != "types"]
    for node in _outside_functions(tree) if top_level_only else ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{name}: relative import in line {node.lineno}"
            for alias in node.names:
                whole = f"{node.module}.{alias.name}"
                yield whole if whole in MODULES else str(node.module)


def _outside_functions(tree: ast.AST) -> Iterator[ast.AST]:
    for child in ast.iter_child_nodes(tree):
        if not isinstance(child, (ast.FunctionDef, ast.AsyncFunctionDef, ast.Lambda)):
            yield child
            yield from _outside_functions(child)


def room_of(name: str) -> str | None:
    """Room of a module, or None for a package whose rooms are listed one by one."""
    return max(
        (room for room in ROW if f"{name}.".startswith(f"{room}.")),
        key=len,
        default=None,
    )


def runs_backwards(importer: str, target: str) -> bool:
    """Whether a module's import of another is against the order of the rooms."""
    here, there = room_of(importer), room_of(target)
    if here is None:
        return there is not None
    if there is None or here == there:
        return False
    return ROW[there] >= ROW[here]


def test_every_module_stands_in_a_room_and_every_room_has_a_module():
    assert [name for name in INSIDE if not room_of(name)] == []
    assert [room for room in ROW if room not in MODULES] == []


def test_no_import_runs_backwards():
    wrong = [
        (name, target)
        for name in INSIDE
        for target in imported(name)
        if target.split(".")[0] in PACKAGES and runs_backwards(name, target)
    ]
    assert wrong == []


def test_the_check_would_see_a_backward_import():
    assert runs_backwards("sidm.learning.dataset", "companion.trials")
    assert runs_backwards("sidm.learning.dataset", "sidm.simulation")
    assert runs_backwards("sidm.learning.dataset", "ownrobot.methods.least_squares")
    assert runs_backwards("sidm.simulation.collect", "sidm.learning")
    assert runs_backwards("sidm.rotations", "sidm.drives")
    assert runs_backwards("companion.engine.run", "companion.studies.ablations")
    assert runs_backwards("sidm", "sidm.config")
    assert not runs_backwards("companion.engine.run", "sidm.simulation")
    assert len(ROOMS) > 15


def test_no_module_imports_itself_in_a_circle():
    """Imports inside functions count, those for annotations alone do not."""
    graph = {
        name: {
            target
            for target in imported(name, annotations=False)
            if target in MODULES and target != name
        }
        for name in MODULES
        if MODULES[name].name != "__init__.py"
    }
    graphlib.TopologicalSorter(graph).prepare()


def test_only_the_simulation_imports_pybullet():
    """Other modules import the simulation inside the function that simulates."""
    for name in MODULES:
        if room_of(name) != "sidm.simulation":
            assert not PYBULLET & {target.split(".")[0] for target in imported(name)}, (
                name
            )
            targets = set(imported(name, top_level_only=True))
            assert not any(
                target.startswith("sidm.simulation") for target in targets
            ), name


def test_what_does_not_learn_does_without_torch():
    plain = [name for name in MODULES if room_of(name) in WITHOUT_TORCH]
    assert [
        name
        for name in plain
        if "torch" in {target.split(".")[0] for target in imported(name)}
    ] == []


def printed(code: str) -> str:
    """What a new process prints that runs some code."""
    words = [sys.executable, "-c", code]
    result = subprocess.run(words, cwd=ROOT, capture_output=True, text=True)
    assert result.returncode == 0, result.stderr
    return result.stdout.strip()


def test_a_trial_of_the_benchmark_starts_without_tables_and_figures():
    code = "import sys, companion.tasks.trial as _; "
    code += "print({'pandas', 'matplotlib'} & {*sys.modules})"
    assert printed(code) == "set()"


def test_every_name_of_the_companion_is_there():
    """The package imports a name's module when the name is first used."""
    code = """
import types, companion
from companion import *
assert not set(companion.__all__) - set(dir(companion))
values = {name: getattr(companion, name) for name in companion.__all__}
print([name for name in values if isinstance(values[name], types.ModuleType)])
"""
    assert printed(code) == "[]"


@pytest.mark.parametrize("name", ["sidm.learning", "ownrobot", "companion.engine.run"])
def test_imports_without_pybullet(name):
    block = "; ".join(f"sys.modules[{module!r}] = None" for module in sorted(PYBULLET))
    printed(f"import sys; {block}; import {name}")
