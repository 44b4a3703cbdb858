"""Folders that tests share, copies of folders, and Python that runs in them."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest


def shared_by_workers(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder that all workers of this test run share."""
    base = tmp_path_factory.getbasetemp()
    return base.parent if "PYTEST_XDIST_WORKER" in os.environ else base


def copy_tree(folder: Path, copy: Path) -> None:
    """Copy a folder by links where it can be: who changes a file writes another one."""

    def link(source: str, target: str) -> None:
        try:
            os.link(source, target)
        except OSError:  # on another disk
            shutil.copy2(source, target)

    shutil.copytree(
        folder,
        copy,
        ignore=shutil.ignore_patterns("__pycache__"),
        copy_function=link,
    )


def run_python(*words: str, **options: object) -> subprocess.CompletedProcess:
    """Python with some words on its command line, and what it printed."""
    command = [sys.executable, *words]
    return subprocess.run(command, capture_output=True, text=True, **options)
