"""The messages of `make setup` before it installs."""

import importlib.util
import platform
import re
import subprocess
import sys
from importlib.metadata import distribution
from pathlib import Path

import pytest

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
        and result.stdout.count("\n") == 1
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


def test_an_older_python_is_refused(requirements, monkeypatch):
    monkeypatch.setattr(sys, "version_info", (3, 10, 13))
    assert requirements.refusal("").startswith("sidm needs Python 3.11 or later")
