"""Fixtures: the book, rendered once for all tests, and a copy of the project."""

import re
import shutil
from pathlib import Path

import pytest
import yaml
from browser import chromium
from IPython.core.interactiveshell import InteractiveShell
from pages import DESK, ROOT, named_modules
from places import copy_tree, run_python, shared_by_workers
from playwright.sync_api import sync_playwright

from companion import all_datasets, collect_motion, load_preset
from sidm.storage import locked
from tests.companion.conftest import (  # noqa: F401
    figure3_frame,
    figure3_rows,
    laptop,
    make_row,
    power_law,
)


@pytest.fixture
def shell(monkeypatch):
    """A shell as a notebook has one; the other tests of this process have none."""
    monkeypatch.setattr(InteractiveShell, "enable_gui", lambda *_: None)  # no window
    yield InteractiveShell.instance()
    InteractiveShell.clear_instance()


@pytest.fixture(scope="session")
def book(tmp_path_factory, pytestconfig) -> Path:
    """Folder of the pages rendered from the committed outputs.

    It is rendered once for all workers; warnings are errors. For `make test` the
    reference has only the modules that pages name, since it takes most of the time.
    """
    output = shared_by_workers(tmp_path_factory) / "book"
    with locked(output):
        if not (output / "_build" / "html" / "index.html").is_file():
            output.mkdir(exist_ok=True)
            render(output, whole=pytestconfig.getoption("markexpr") != "not more")
    return output / "_build" / "html"


def render(output: Path, whole: bool) -> None:
    """Build the book under `output`, with or without the whole reference."""
    config = yaml.safe_load((ROOT / "_config.yml").read_text(encoding="utf-8"))
    sphinx = config["sphinx"]
    for name, folder in sphinx["local_extensions"].items():
        sphinx["local_extensions"][name] = str(ROOT / folder)
    if not whole:
        sphinx["config"]["autosummary_context"] = {"only": named_modules()}
    (output / "config.yml").write_text(yaml.safe_dump(config), encoding="utf-8")
    arguments = f"build --warningiserror --keep-going --path-output {output} {ROOT}"
    arguments += f" --config {output / 'config.yml'}"
    program = "import sys; from jupyter_book.cli.main import main; sys.exit(main())"
    result = run_python("-c", program, *arguments.split())
    if result.returncode != 0:
        shutil.rmtree(output, ignore_errors=True)
        said = result.stdout + result.stderr
        problems = re.findall(r"^.*(?:WARNING|ERROR).*$", said, re.MULTILINE)
        pytest.fail("\n".join(problems) or said[-4000:])


@pytest.fixture(scope="session")
def motion(tmp_path_factory) -> Path:
    """The data of the smoke preset for system 1, collected once for all workers."""
    folder = shared_by_workers(tmp_path_factory) / "motion"
    with locked(folder):
        needed = all_datasets(load_preset("smoke"), ["system1"])
        collect_motion(needed, folder, workers=2, progress=False)
    return folder


@pytest.fixture(scope="session")
def project(tmp_path_factory, motion) -> Path:
    """A worker's copy of what the notebooks work with: trials are run in it once."""
    copy = tmp_path_factory.mktemp("copy") / "project"
    for name in (
        "sidm",
        "companion",
        "notebooks",
        "params",
        "results",
        "recordings",
        "benchmarks",
    ):
        copy_tree(ROOT / name, copy / name)
    copy_tree(motion, copy / "_build" / "smoke" / "data")
    return copy


def pytest_collection_modifyitems(
    config: pytest.Config, items: list[pytest.Item]
) -> None:
    """Without a browser, leave out the tests that need one.

    `test_a_browser_is_there` says so for all of them.
    """
    if chromium() is None:
        paged = [
            item for item in items if "context" in getattr(item, "fixturenames", ())
        ]
        config.hook.pytest_deselected(items=paged)
        items[:] = [item for item in items if item not in paged]


# for one module: its event loop holds the thread and must close before others start
@pytest.fixture(scope="module")
def context():
    """A browser window without a network."""
    with sync_playwright() as play:
        nowhere = "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1"
        browser = play.chromium.launch(executable_path=chromium(), args=[nowhere])
        yield browser.new_context(offline=True, viewport=DESK)
        browser.close()
