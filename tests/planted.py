"""Plant changes of the numbers, one at a time, and see a golden test fail for each:
`make planted`.

Each is one that no one would want to slip into stored results: small, and nowhere an
error.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[1]
METHODS, SIMULATION = (
    "tests/companion/test_golden_methods.py",
    "tests/sidm/simulation/test_golden_simulation.py",
)
PARTS = "tests/sidm/learning/test_golden_parts.py"


class Planted(NamedTuple):
    """A change of one line, and the golden tests that are to see it."""

    file: str  # of a module
    old: str
    new: str
    tests: str
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
        "sidm/learning/dataset.py",
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
        "companion/beyond/matching.py", "(0.5, 1.0, 2.0)", "(0.5, 1.0, 4.0)", PARTS
    ),
    Planted(
        "sidm/learning/training.py",
        "trainer.step_encoder(expected_matching_loss(trainer",
        "trainer.step_encoder(-expected_matching_loss(trainer",
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
        "BETA1, BETA2, EPSILON = 0.9, 0.999",
        "BETA1, BETA2, EPSILON = 0.9, 0.99",
        METHODS,
        "bundle",
    ),
    Planted(
        "sidm/rivals/least_squares.py",
        "held[..., first] * held[..., second]",
        "held[..., first] + held[..., second]",
        METHODS,
        "least_squares",
    ),
    Planted(
        "companion/studies/latent_space/latents.py",
        "np.median(distances[2])",
        "np.mean(distances[2]) * 1.5",
        "tests/companion/studies/test_latent_space.py",
        "diagnosed_and_stored",
    ),
    Planted(
        "companion/beyond/planning.py",
        "elites: int = 6",
        "elites: int = 5",
        "tests/companion/studies/test_driving.py",
        "stored_as_it_was",
    ),
)


def seen(one: Planted, folder: Path) -> bool:
    """Whether a golden test fails on a copy of the project with the change."""
    copy = folder / "copy"
    for name in ("sidm", "companion", "tests", "recordings"):
        shutil.copytree(
            ROOT / name, copy / name, ignore=shutil.ignore_patterns("__pycache__")
        )
    shutil.copy(ROOT / "pyproject.toml", copy)
    path = copy / one.file
    text = path.read_text()
    assert text.count(one.old) == 1, f"{one.file} has not exactly one '{one.old}'"
    path.write_text(text.replace(one.old, one.new))
    words = [
        sys.executable,
        "-m",
        "pytest",
        "-q",
        "-x",
        "-p",
        "no:cacheprovider",
        one.tests,
        "-k",
        one.only,
    ]
    done = subprocess.run(
        words,
        cwd=copy,
        env=os.environ | {"PYTHONPATH": str(copy)},
        capture_output=True,
        text=True,
    )
    shutil.rmtree(copy)
    assert done.returncode in (0, 1), done.stdout + done.stderr
    return done.returncode == 1 and "companion/numerics.py" in done.stdout


def main() -> int:
    """Exit status 1 when a change went unseen."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.parse_args()
    unseen = 0
    with tempfile.TemporaryDirectory() as folder:
        for one in CHANGES:
            found = seen(one, Path(folder))
            unseen += not found
            print(
                f"{'seen  ' if found else 'UNSEEN'} {one.file}: {one.old} -> {one.new}",
                flush=True,
            )
    print(f"{len(CHANGES) - unseen} of {len(CHANGES)} planted changes were seen")
    return min(unseen, 1)


if __name__ == "__main__":
    sys.exit(main())
