"""The book, built once for all tests of its pages, and a copy of the project for what runs."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from pages import DESK, ROOT
from pdf import BROWSERS
from playwright.sync_api import sync_playwright


@pytest.fixture(scope="session")
def book(tmp_path_factory) -> Path:
    """The folder of pages rendered from the committed outputs, warnings being errors."""
    output = tmp_path_factory.mktemp("book")
    words = ["build", "--warningiserror", "--keep-going", "--path-output", str(output), str(ROOT)]
    program = "import sys; from jupyter_book.cli.main import main; sys.exit(main())"
    done = subprocess.run([sys.executable, "-c", program, *words], capture_output=True, text=True)
    problems = [line for line in (done.stdout + done.stderr).splitlines() if "WARNING" in line or "ERROR" in line]
    assert done.returncode == 0, "\n".join(problems) or done.stdout[-2000:] + done.stderr[-2000:]
    return output / "_build" / "html"


@pytest.fixture(scope="session")
def project(tmp_path_factory) -> Path:
    """A copy of what the notebooks work with, shared by all workers: data are collected and trials run in it once."""
    base = tmp_path_factory.getbasetemp()
    shared = (base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / "project"
    own = tmp_path_factory.mktemp("copy") / "project"
    for name in ("sidm", "notebooks", "params", "results", "recordings"):
        shutil.copytree(ROOT / name, own / name, ignore=shutil.ignore_patterns("__pycache__"))
    try:
        own.rename(shared)
    except OSError:  # another worker was first
        shutil.rmtree(own)
    return shared


@pytest.fixture(scope="session")
def context():
    """A browser without a network."""
    path = next(filter(None, map(shutil.which, BROWSERS)), None)
    if path is None and not os.environ.get("CI"):
        pytest.skip("no Chromium found; install Debian's package 'chromium' to test the pages")
    assert path is not None, "no Chromium found, and under CI the tests of the pages may not be skipped"
    with sync_playwright() as play:
        nowhere = "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1"
        browser = play.chromium.launch(executable_path=path, args=[nowhere])
        yield browser.new_context(offline=True, viewport=DESK)
        browser.close()
