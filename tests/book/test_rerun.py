"""The page 'run it again', word by word: what its commands print is what stands there."""

import re
import shlex
import subprocess
import sys

import pytest
from pages import ROOT

BLOCK = re.compile(r"^```console\n(.*?)^```", re.MULTILINE | re.DOTALL)


def sessions() -> list[tuple[str, str]]:
    """Command and output, of every command of the page that shows what it prints."""
    text = (ROOT / "book" / "rerun.md").read_text(encoding="utf-8")
    found = []
    for block in BLOCK.findall(text):
        for part in re.split(r"^\$ ", block, flags=re.MULTILINE)[1:]:
            command, _, output = part.partition("\n")
            found.append((command, output))
    return found


def test_the_page_shows_what_commands_print():
    assert len(sessions()) >= 4


@pytest.mark.parametrize(("command", "output"), sessions())
def test_a_command_prints_what_the_page_says(project, command, output):
    program, *words = shlex.split(command)
    assert program == ".venv/bin/sidm"
    done = subprocess.run([sys.executable, "-m", "sidm", *words], cwd=project, capture_output=True, text=True)
    assert (done.stdout + done.stderr).splitlines() == output.splitlines()
    assert done.returncode == (2 if output.startswith("sidm: ") else 0)
