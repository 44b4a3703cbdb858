"""Change a number of the code, one place at a time, and see a golden test fail.

`make planted` runs these tests. Each planted change is small, raises no error, and
would silently change the stored results.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import pytest

ROOT = Path(__file__).parents[1]
METHODS = "tests/companion/test_golden_methods.py"
SIMULATION = "tests/sidm/simulation/test_golden_simulation.py"
STUDIES = "tests/companion/studies/test_studies.py"
PARTS = "tests/sidm/learning/test_golden_parts.py"


class Planted(NamedTuple):
    """A change of one line of code, and the golden tests that must see it."""

    file: str  # path of the module below ROOT
    old: str
    new: str
    tests: str  # file of the golden tests
    only: str = ""  # pytest's -k


CHANGES = (
    Planted(
        "sidm/systems.py",
        "smoothing: float = 0.7",
        "smoothing: float = 0.72",
        SIMULATION,
        "ground",
    ),
    Planted(
        "sidm/simulation/suspension.py",
        "heave_damping=1050.0",
        "heave_damping=1040.0",
        SIMULATION,
        "robot",
    ),
    Planted(
        "sidm/simulation/exploration.py", "keep=0.99", "keep=0.98", SIMULATION, "policy"
    ),
    Planted(
        "sidm/body.py", "map_size=5.0", "map_size=4.9", METHODS, "sidm or novice_only"
    ),
    Planted(
        "sidm/settings.py",
        "slope: float = 0.01",
        "slope: float = 0.03",
        METHODS,
        "sidm or novice_only",
    ),
    Planted(
        "sidm/shards.py",
        "np.arange(count) % TEST_EVERY == 1",
        "np.arange(count) % TEST_EVERY == 0",
        METHODS,
        "novice_only",
    ),
    Planted(
        "sidm/learning/training.py",
        "torch.cat(list(losses.values())).mean()",
        "torch.stack([one.mean() for one in losses.values()]).mean()",
        METHODS,
        "sidm",
    ),
    Planted(
        "companion/extensions/trainer.py", "(0.5, 1.0, 2.0)", "(0.5, 1.0, 4.0)", PARTS
    ),
    Planted(
        "sidm/learning/training.py",
        "loss = expected_matching_loss(trainer",
        "loss = -expected_matching_loss(trainer",
        METHODS,
        "strong_matching",
    ),
    Planted(
        "sidm/learning/stopping.py",
        "weight * past + (1 - weight) * now",
        "now",
        METHODS,
        "sidm",
    ),
    Planted(
        "companion/bundle/adam.py",
        "BETAS, EPSILON = (0.9, 0.999)",
        "BETAS, EPSILON = (0.9, 0.99)",
        METHODS,
        "bundle",
    ),
    Planted(
        "ownrobot/methods/least_squares.py",
        "held = numbers.clamp(self.low, self.high)",
        "held = numbers.clamp(self.low / 2, self.high / 2)",
        METHODS,
        "least_squares",
    ),
    Planted(
        "companion/studies/latent_space/latents.py",
        "np.median(distances[2])",
        "np.mean(distances[2]) * 1.5",
        STUDIES,
        "latent",
    ),
    Planted(
        "companion/extensions/planning.py",
        "costs.argsort(stable=True)",
        "costs.argsort(stable=True, descending=True)",
        STUDIES,
        "driving",
    ),
)


def plant(change: Planted, folder: Path) -> None:
    """Change the module below a folder."""
    path = folder / change.file
    text = path.read_text()
    count = text.count(change.old)
    assert count == 1, f"{change.file} has '{change.old}' {count} times, not once"
    path.write_text(text.replace(change.old, change.new))


def is_seen(change: Planted, folder: Path) -> bool:
    """Whether a golden test fails on a copy of the project with the change."""
    copy = folder / "copy"
    for name in ("sidm", "ownrobot", "companion", "tests", "recordings"):
        shutil.copytree(
            ROOT / name, copy / name, ignore=shutil.ignore_patterns("__pycache__")
        )
    shutil.copy(ROOT / "pyproject.toml", copy)
    plant(change, copy)
    pytest = [sys.executable, "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider"]
    run = subprocess.run(
        [*pytest, change.tests, "-k", change.only],
        cwd=copy,
        env=os.environ | {"PYTHONPATH": str(copy)},
        capture_output=True,
        text=True,
    )
    shutil.rmtree(copy)
    assert run.returncode in (0, 1), run.stdout + run.stderr
    return run.returncode == 1 and "companion/numerics.py" in run.stdout


@pytest.mark.parametrize("change", CHANGES, ids=lambda change: change.file)
def test_a_planted_change_has_its_place(tmp_path, change):
    target = tmp_path / change.file
    target.parent.mkdir(parents=True)
    shutil.copy(ROOT / change.file, target)
    plant(change, tmp_path)
    compile(target.read_text(), change.file, "exec")
    assert (ROOT / change.tests).is_file()


@pytest.mark.more
@pytest.mark.parametrize("change", CHANGES, ids=lambda change: change.file)
def test_a_planted_change_is_seen(tmp_path, change):
    assert is_seen(change, tmp_path)
