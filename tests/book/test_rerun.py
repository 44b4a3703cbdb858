"""Commands of the page 'run it again' print exactly what the page shows."""

import re
import shlex
import subprocess
import sys

import pytest
from pages import ROOT, source

PAGE = "notebooks/15-run-again"
BLOCK = re.compile(r"^```console\n(.*?)^```", re.MULTILINE | re.DOTALL)


def sessions() -> list[tuple[str, str]]:
    """Command and output of every command of the page that shows its output."""
    text = source(PAGE)
    shown = []
    for block in BLOCK.findall(text):
        for part in re.split(r"^\$ ", block, flags=re.MULTILINE)[1:]:
            command, _, output = part.partition("\n")
            shown.append((command, output))
    return shown


def test_the_page_shows_what_commands_print():
    assert len(sessions()) >= 4


@pytest.mark.more
@pytest.mark.parametrize(("command", "output"), sessions())
def test_a_command_prints_what_the_page_says(project, command, output):
    program, *words = shlex.split(command)
    if words[:2] == ["notebook", "robots"]:  # smaller, and nothing else
        words += ["-f", "params/smoke.yaml", "-p", "grounds", "1", "-p", "steps", "10"]
    assert program == ".venv/bin/companion"
    result = subprocess.run(
        [sys.executable, "-m", "companion", *words],
        cwd=project,
        capture_output=True,
        text=True,
    )
    assert (result.stdout + result.stderr).splitlines() == output.splitlines()
    assert result.returncode == (2 if output.startswith("companion: ") else 0)


def test_what_a_bundle_gains_on_a_gpu_is_what_was_measured():
    page = " ".join(source(PAGE).split())
    text = (ROOT / "benchmarks" / "bundle.txt").read_text(encoding="utf-8")
    measured = text.split("\n\n")[0]
    assert "H200" in measured.splitlines()[0]
    gains = {}
    for name, precision, trials, numbers in re.findall(
        r"^(.+ px), (\w+), +(\d+): (.+)$", measured, re.MULTILINE
    ):
        gains[name, precision, int(trials)] = float(numbers.split(";")[4])
    alone = gains["3 x 256, 64 px", "float32", 128]
    assert f"{alone:.1f} times as fast side by side" in page
    apart = float(re.search(r"differ by at most (\S+),", measured)[1])
    assert f"differ there by up to {apart:.1%}".replace("%", " %") in page
    together = int(re.search(r"(\d+) samples/s; when", measured)[1])
    assert f"made {together:,} samples a second together" in page
    assert "128 trainings" in page
    kernels = re.findall(r"(\d{5,}) /\s+(\d{5,}) samples/s", measured.replace("# ", ""))
    of_two, of_eight = (int(after) / int(before) for before, after in kernels)
    assert f"recipe R are {of_two:.1f} times as fast as before" in page
    assert f"16 trainings with batches of 8 are {of_eight:.1f} times as fast" in page
