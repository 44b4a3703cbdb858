"""The messages of `make setup` before it installs."""

import importlib.util
import platform
import re
import subprocess
import sys
from collections import namedtuple
from importlib.metadata import distribution
from pathlib import Path

import pytest

from tests import resolve

ROOT = Path(__file__).parents[1]


@pytest.fixture
def requirements():
    spec = importlib.util.spec_from_file_location(
        "requirements", ROOT / "requirements.py"
    )
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_it_announces_what_is_coming():
    result = subprocess.run(
        [sys.executable, ROOT / "requirements.py"], capture_output=True, text=True
    )
    pins = "".join(
        (ROOT / name).read_text() for name in ("requirements.txt", "constraints.txt")
    )
    assert (
        result.returncode == 0
        and result.stderr == ""
        and result.stdout.count("\n") <= 2
    )
    count = len(re.findall(r"^[\w.-]+==", pins, re.MULTILINE))
    assert f"Python {platform.python_version()}: {count} packages" in result.stdout


def test_it_knows_where_pybullet_has_a_wheel(requirements):
    """pip records what is installed: an index's wheel is for many Linuxes.

    A wheel that was built here is for this one.
    """
    pybullet = distribution("pybullet")
    assert pybullet.version in (requirements.pybullet_has_wheel.__doc__ or "")
    assert requirements.pybullet_has_wheel() == (
        "manylinux" in str(pybullet.read_text("WHEEL"))
    )


def test_a_compiler_that_is_missing_is_named_before_pip_fails(
    requirements, monkeypatch
):
    monkeypatch.setattr(requirements, "pybullet_has_wheel", lambda: False)
    message = requirements.refusal("no-such-compiler")
    assert "PyBullet has no ready build" in message
    assert "install a C++ compiler (no-such-compiler)" in message
    assert "to compile PyBullet" in requirements.announcement()


def test_missing_headers_are_named(requirements, monkeypatch, tmp_path):
    monkeypatch.setattr(requirements, "pybullet_has_wheel", lambda: False)
    monkeypatch.setattr(requirements.sysconfig, "get_path", lambda _: str(tmp_path))
    assert "install Python's headers (python3-dev), or take" in requirements.refusal(
        sys.executable
    )
    (tmp_path / "Python.h").touch()
    assert requirements.refusal(sys.executable) == ""


@pytest.mark.parametrize("version", [(3, 10, 13), (3, 14, 0)])
def test_a_python_too_old_or_too_new_is_refused(requirements, monkeypatch, version):
    monkeypatch.setattr(sys, "version_info", version)
    message = requirements.refusal("")
    assert message.startswith("sidm needs Python 3.11 to 3.13, not")
    assert "make setup PYTHON=" in message


@pytest.mark.parametrize(
    ("index", "least", "hint"),
    [("", 7.0, True), ("https://download.pytorch.org/whl/cpu", 3.5, False)],
    ids=["CUDA", "CPU"],
)
def test_a_disk_too_small_is_refused(requirements, monkeypatch, index, least, hint):
    usage = namedtuple("usage", "free")
    monkeypatch.setattr(requirements.sys, "platform", "linux")
    monkeypatch.setattr(requirements, "pybullet_has_wheel", lambda: True)
    monkeypatch.setenv("PIP_EXTRA_INDEX_URL", index)
    monkeypatch.setattr(requirements.shutil, "disk_usage", lambda _: usage(2.5e9))
    message = requirements.refusal("")
    assert "2.5 GB free, and setting up takes" in message and "\n" not in message
    assert float(re.search(r"takes ([\d.]+) GB", message)[1]) >= least
    assert ("make setup" in message) == hint
    monkeypatch.setattr(requirements.shutil, "disk_usage", lambda _: usage(20e9))
    assert requirements.refusal("") == ""
    assert ("3 GB less" in requirements.announcement()) == hint


def test_what_torch_decides_has_no_version_here():
    """Torch fixes the version of triton and of the libraries of its CUDA build."""
    pins = (ROOT / "requirements.txt").read_text()
    pins += (ROOT / "constraints.txt").read_text()
    assert not re.search(r"^(triton|nvidia|cuda)", pins, re.MULTILINE)


def test_supported_pythons_are_the_same_everywhere(requirements):
    project = (ROOT / "pyproject.toml").read_text()
    listed = re.findall(r"Python :: (3\.\d+)", project)
    assert tuple(listed) == resolve.PYTHONS
    ends = requirements.OLDEST, requirements.NEWEST
    assert [".".join(map(str, end)) for end in ends] == [listed[0], listed[-1]]
    workflow = (ROOT / ".github" / "workflows" / "test.yml").read_text()
    for version in listed:
        assert f'"{version}"' in workflow
