"""In an empty environment, the wheel works with the least dependencies."""

import importlib.metadata
import re
import shutil
import subprocess
import sys
import venv
from pathlib import Path

import pytest

pytestmark = pytest.mark.more

ROOT = Path(__file__).parents[1]
WARTHOG = ROOT / "recordings" / "warthog.csv.gz"
SKID = ROOT / "recordings" / "skid_steer.yaml"
EXTRA = re.compile(r";.*extra\s*==")


def needed(names: set[str]) -> set[str]:
    """Distributions that some distributions need, with themselves.

    Needs of a package's extras are left out.
    """
    found: set[str] = set()
    waiting = [name.lower() for name in names]
    while waiting:
        name = waiting.pop()
        try:
            lines = importlib.metadata.requires(name) or []
        except importlib.metadata.PackageNotFoundError:
            continue  # a requirement of another operating system
        if name not in found:
            plain = [line for line in lines if not EXTRA.search(line)]
            waiting += [re.match(r"[\w.-]+", line)[0].lower() for line in plain]
        found.add(name)
    return found


@pytest.fixture(scope="module")
def wheel(tmp_path_factory) -> Path:
    """The wheel, built from a copy without a network."""
    folder = tmp_path_factory.mktemp("wheel")
    for name in ("sidm", "ownrobot", "companion"):
        shutil.copytree(
            ROOT / name,
            folder / "source" / name,
            ignore=shutil.ignore_patterns("__pycache__"),
        )
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, folder / "source")
    pip = f"-m pip wheel --no-deps --no-build-isolation --quiet -w {folder}".split()
    words = [sys.executable, *pip, str(folder / "source")]
    result = subprocess.run(words, capture_output=True, text=True)
    assert result.returncode == 0, result.stderr
    return next(folder.glob("sidm-*.whl"))


@pytest.fixture(scope="module")
def least(wheel, tmp_path_factory) -> Path:
    """Python of an environment with the wheel and only its requirements."""
    folder = tmp_path_factory.mktemp("least")
    venv.create(folder / "env", with_pip=False, symlinks=True)
    packages = folder / "packages"
    packages.mkdir()
    unpacked = folder / "unpacked"
    subprocess.run([sys.executable, "-m", "zipfile", "-e", wheel, unpacked], check=True)
    (metadata,) = unpacked.glob("sidm-*.dist-info/METADATA")
    lines = re.findall(r"^Requires-Dist: (.+)$", metadata.read_text(), re.MULTILINE)
    names = {re.match(r"[\w.-]+", line)[0] for line in lines if "extra ==" not in line}  # type: ignore[index]
    assert names == set("numpy scipy torch pandas tqdm PyYAML safetensors".split())
    for name in needed(names):
        for file in importlib.metadata.files(name) or []:
            top = file.parts[0]
            if top not in ("..", "__pycache__") and not (packages / top).exists():
                (packages / top).symlink_to(
                    file.locate().parents[len(file.parts) - 1] / top
                )
    (site,) = (folder / "env").glob("lib/python*/site-packages")
    (site / "least.pth").write_text(f"{unpacked}\n{packages}\n")
    return folder / "env" / "bin" / "python"


def run(python: Path, folder: Path, *words: str) -> subprocess.CompletedProcess:
    return subprocess.run(
        [python, "-P", *words],
        cwd=folder,
        capture_output=True,
        text=True,
        env={"PATH": "/usr/bin"},
    )


def test_a_model_is_fitted_from_a_csv_file_there(least, tmp_path):
    code = """
import ownrobot, sys
few = {"method": "novice_only", "settings": {"max_samples": 4000}}
ownrobot.fit(sys.argv[1], body=sys.argv[2], out="m", **few)
print(ownrobot.load("m"))
assert not {"matplotlib", "pybullet", "numba", "companion"} & set(sys.modules)
"""
    result = run(least, tmp_path, "-c", code, str(WARTHOG), str(SKID))
    assert result.returncode == 0, result.stderr
    assert result.stdout.startswith("Model('novice_only'")


def test_the_commands_work_there_or_say_what_they_lack(least, tmp_path):
    command = "-m", "ownrobot"
    result = run(least, tmp_path, *command, "demo")
    assert result.returncode == 0, result.stderr
    assert (tmp_path / "ownrobot-demo" / "replay.html").exists()
    model = "ownrobot-demo/model"
    result = run(least, tmp_path, *command, "evaluate", model, str(WARTHOG))
    assert result.returncode == 0 and "yaw_rate" in result.stdout
    assert "pip install 'sidm[plots]'" in result.stderr
    code = "import sidm; sidm.simulate('system1', 'novice', 0.2)"
    result = run(least, tmp_path, "-c", code)
    assert result.returncode == 1
    assert "simulating needs PyBullet: pip install" in result.stderr.splitlines()[-1]
