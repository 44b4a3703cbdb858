"""Imports go one way, and what does not simulate does without PyBullet."""

import ast
import graphlib
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

import sidm

PACKAGE = Path(sidm.__file__).parent
ROOT = PACKAGE.parent

#: Wings by rank: a module imports from wings of a lower rank and from its own, not from others of its rank.
RANKS = [
    ["config", "lazy", "numerics", "storage", "pool", "cluster", "progress"],
    ["systems"],
    ["terrain", "rotations", "trajectory"],
    ["recordings"],
    ["simulation", "learning"],
    ["control"],
    ["experiments"],
    ["explorer", "book", "notebook_runs"],
    ["notebook"],
    ["__main__"],
]
RANK = {wing: rank for rank, wings in enumerate(RANKS) for wing in wings}

#: Inside `learning`, first to last: the paper's method, many trainings at once, and what is beyond the paper.
LEARNING = [
    "seeds", "settings", "precision", "observation", "dataset", "mirror", "losses", "initialisation", "networks",
    "model", "evaluation", "weights", "stopping", "checkpoint", "learner", "regularisation", "training", "bundle",
    "beyond",
]  # fmt: skip

#: Inside `experiments`, first to last; `engine` has what keeps data and results, before the trials are run.
EXPERIMENTS = [
    "trials", "presets", "methods", "tries", "engine.likeness", "engine.datasets", "study", "engine", "statistics",
    "figures", "studies", "grids",
]  # fmt: skip

PYBULLET = {"pybullet", "pybullet_data", "pybullet_utils"}


def modules() -> dict[str, Path]:
    """Dotted name -> file, of every module of the package."""
    found = {}
    for path in sorted(PACKAGE.rglob("*.py")):
        parts = path.relative_to(ROOT).with_suffix("").parts
        found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


MODULES = modules()


def imported(name: str, top_level_only: bool = False) -> Iterator[str]:
    """Dotted names of what a module imports, `from a import b` as a.b where that is a module."""
    tree = ast.parse(MODULES[name].read_text(encoding="utf-8"))
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


def wing(name: str) -> str | None:
    """The wing of a module of the package; None for the package itself."""
    parts = name.split(".")
    return parts[1] if len(parts) > 1 else None


def runs_backwards(importer: str, target: str) -> bool:
    """Whether a module's import of another is against the order of the wings."""
    here, there = wing(importer), wing(target)
    if here is None:
        return there is not None
    if there is None or here == there:
        return False
    return RANK[there] >= RANK[here]


@pytest.mark.parametrize("name", [name for name in MODULES if name != "sidm"])
def test_every_module_belongs_to_a_known_wing(name):
    assert wing(name) in RANK


@pytest.mark.parametrize("name", list(MODULES))
def test_no_import_runs_backwards(name):
    ours = [target for target in imported(name) if target.split(".")[0] == "sidm"]
    assert [target for target in ours if runs_backwards(name, target)] == []


def test_the_check_would_see_a_backward_import():
    assert runs_backwards("sidm.learning.dataset", "sidm.experiments.trials")
    assert runs_backwards("sidm.learning.dataset", "sidm.simulation")
    assert runs_backwards("sidm.simulation.collect", "sidm.learning")
    assert runs_backwards("sidm.rotations", "sidm.trajectory")
    assert runs_backwards("sidm", "sidm.config")
    assert not runs_backwards("sidm.experiments.engine.run", "sidm.simulation")


def test_learning_imports_in_its_own_order():
    for name in (name for name in MODULES if name.startswith("sidm.learning.")):
        own = name.split(".")[2]
        allowed = {own, *LEARNING[: LEARNING.index(own)]}
        inner = [target.split(".")[2] for target in imported(name) if target.startswith("sidm.learning.")]
        assert [target for target in inner if target not in allowed] == [], name


def room(name: str) -> int:
    """The place of a module of `experiments` among the rooms there."""
    inner = f"{name.removeprefix('sidm.experiments.')}."
    return EXPERIMENTS.index(max((start for start in EXPERIMENTS if inner.startswith(f"{start}.")), key=len))


@pytest.mark.parametrize("name", [name for name in MODULES if name.startswith("sidm.experiments.")])
def test_experiments_import_in_the_order_of_their_rooms(name):
    inner = [target for target in imported(name) if target.startswith("sidm.experiments.")]
    assert [target for target in inner if room(target) > room(name)] == []


def test_no_module_imports_itself_in_a_circle():
    graph = {
        name: {target for target in imported(name, top_level_only=True) if target in MODULES and target != name}
        for name in MODULES
        if MODULES[name].name != "__init__.py"
    }
    graphlib.TopologicalSorter(graph).prepare()


@pytest.mark.parametrize("name", [name for name in MODULES if wing(name) != "simulation"])
def test_only_the_simulation_imports_pybullet(name):
    assert not PYBULLET & {target.split(".")[0] for target in imported(name)}
    ours = set(imported(name, top_level_only=True))
    assert not any(target.startswith("sidm.simulation") for target in ours), "import it inside the function"


@pytest.mark.parametrize("name", [name for name in MODULES if wing(name) in ("terrain", "simulation", "trajectory")])
def test_simulation_does_without_torch(name):
    assert "torch" not in {target.split(".")[0] for target in imported(name)}


@pytest.mark.parametrize("name", ["sidm.learning", "sidm.experiments"])
def test_every_name_of_a_lazy_package_is_there(name):
    code = f"import types, {name} as package; from {name} import *; "
    code += "assert not set(package.__all__) - set(dir(package)); "
    code += "print([n for n in package.__all__ if isinstance(getattr(package, n), types.ModuleType)])"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True)
    assert done.stdout.strip() == "[]", done.stderr


@pytest.mark.parametrize("name", ["sidm", "sidm.learning", "sidm.experiments"])
def test_imports_without_pybullet(name):
    block = "; ".join(f"sys.modules[{module!r}] = None" for module in sorted(PYBULLET))
    done = subprocess.run(
        [sys.executable, "-c", f"import sys; {block}; import {name}"], cwd=ROOT, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
