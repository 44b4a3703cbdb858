"""The README's commands run, with a preset of seconds in place of one of hours."""

import os
import re
import shutil
import subprocess
import sys

import pytest
from pages import ROOT
from places import copy_tree

BLOCKS = re.compile(r"^```(\w+)\n(.*?)^```", re.MULTILINE | re.DOTALL)
README = (ROOT / "README.md").read_text(encoding="utf-8")

#: parts of commands and their replacements, which change sizes and nothing else
SMALLER = {
    "-p rock_height": "-f params/smoke.yaml -p grounds 1 -p steps 10 -p rock_height",
    "--out model": "--out model --set max_samples=4000",
    "compare drives/": "compare drives/ --methods mean least_squares --repeats 1",
}


def commands(kind: str) -> list[str]:
    """Lines of one language in the README, without `make`, which other tests cover."""
    blocks = [text for language, text in BLOCKS.findall(README) if language == kind]
    lines = [
        line.partition("  #")[0].strip()
        for text in blocks
        for line in text.splitlines()
    ]
    return [line for line in lines if line and not line.startswith("make ")]


@pytest.fixture(scope="module")
def place(project, tmp_path_factory):
    """A copy of the project with a user's files under the README's names."""
    folder = tmp_path_factory.mktemp("readme") / "project"
    copy_tree(project, folder)
    shutil.copy(folder / "recordings" / "skid_steer.yaml", folder / "robot.yaml")
    for name, robot in (("drives", "warthog"), ("other-drives", "husky")):
        (folder / name).mkdir()
        shutil.copy(folder / "recordings" / f"{robot}.csv.gz", folder / name)
    shutil.copy(folder / "recordings" / "warthog.csv.gz", folder / "drive.csv.gz")
    subprocess.run(["gunzip", "drive.csv.gz"], cwd=folder, check=True)
    return folder


def test_every_command_is_one_of_these_packages():
    assert len(commands("bash")) >= 9
    expected = {
        f".venv/bin/{name}" for name in "companion ownrobot papermill jupyter".split()
    }
    assert {line.split()[0] for line in commands("bash")} == expected


def test_the_commands_do_what_they_say(place):
    """Commands run in the README's order: later ones use results of earlier ones."""
    for command in commands("bash"):
        for words, smaller in SMALLER.items():
            command = command.replace(words, smaller)
        program, *words = command.split()
        result = subprocess.run(
            [sys.executable, "-m", os.path.basename(program), *words],
            cwd=place,
            capture_output=True,
            text=True,
        )
        assert result.returncode == 0, f"{command}\n{result.stderr[-2000:]}"
    for made in (
        "mine.ipynb",
        "mine.html",
        "model/model.safetensors",
        "evaluation.png",
        "comparison/report.html",
    ):
        assert (place / made).exists(), made
