"""Commands and code that README and pages show do what they say, at small sizes."""

import os
import re
import shlex
import shutil
import subprocess

import pytest
from pages import ROOT, source
from places import copy_tree, run_python

from ownrobot.fitting import learning

BLOCKS = re.compile(r"^```(\w+)\n(.*?)^```", re.MULTILINE | re.DOTALL)
README = (ROOT / "README.md").read_text(encoding="utf-8")
RUN_AGAIN, OWN_ROBOT = "notebooks/15-run-again", "notebooks/16-own-robot"
#: parts of the README's commands and their replacements, which change sizes alone
SMALLER = {
    "-p rock_height": "-f params/smoke.yaml -p grounds 1 -p steps 10 -p rock_height",
    "--out model": "--out model --set max_samples=4000",
    "compare drives/": "compare drives/ --methods mean least_squares --repeats 1",
}
#: the same for the Python of the page on one's own robot
SMALLER_PYTHON = {
    r"minutes=\d+": "minutes=0.3",
    r'"max_samples": [\d_]+': '"max_samples": 4000',
    r"repeats=1\n\)": 'repeats=1, methods=["mean", "corrected"], shares=[1])',
}


def blocks(text: str, kind: str) -> list[str]:
    """The blocks of one language in a text."""
    return [block for language, block in BLOCKS.findall(text) if language == kind]


def readme_commands() -> list[str]:
    """The README's commands without `make`, which other tests cover."""
    lines = "\n".join(blocks(README, "bash")).splitlines()
    lines = [line.partition("  #")[0].strip() for line in lines]
    return [line for line in lines if line and not line.startswith("make ")]


def sessions() -> list[tuple[str, str]]:
    """Command and output of 'run it again', where the page shows the output."""
    shown = []
    for block in blocks(source(RUN_AGAIN), "console"):
        for part in re.split(r"^\$ ", block, flags=re.MULTILINE)[1:]:
            command, _, output = part.partition("\n")
            shown.append((command, output))
    return shown


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


def test_the_readmes_commands_do_what_they_say(place):
    """Commands run in the README's order: later ones use results of earlier ones."""
    assert len(readme_commands()) >= 9
    programs = {line.split()[0] for line in readme_commands()}
    names = "companion ownrobot papermill jupyter".split()
    assert programs == {f".venv/bin/{name}" for name in names}
    for command in readme_commands():
        for words, smaller in SMALLER.items():
            command = command.replace(words, smaller)
        program, *words = command.split()
        result = run_python("-m", os.path.basename(program), *words, cwd=place)
        assert result.returncode == 0, f"{command}\n{result.stderr[-2000:]}"
    for made in (
        "mine.ipynb",
        "mine.html",
        "model/model.safetensors",
        "evaluation.png",
        "comparison/report.html",
    ):
        assert (place / made).exists(), made


def test_run_again_shows_what_commands_print():
    assert len(sessions()) >= 4


@pytest.mark.more
@pytest.mark.parametrize(("command", "output"), sessions())
def test_a_command_prints_what_the_page_says(project, command, output):
    program, *words = shlex.split(command)
    if words[:2] == ["notebook", "robots"]:  # smaller, and nothing else
        words += ["-f", "params/smoke.yaml", "-p", "grounds", "1", "-p", "steps", "10"]
    assert program == ".venv/bin/companion"
    result = run_python("-m", "companion", *words, cwd=project)
    assert (result.stdout + result.stderr).splitlines() == output.splitlines()
    assert result.returncode == (2 if output.startswith("companion: ") else 0)


def test_what_a_bundle_gains_on_a_gpu_is_what_was_measured():
    page = " ".join(source(RUN_AGAIN).split())
    text = (ROOT / "benchmarks" / "bundle.txt").read_text(encoding="utf-8")
    measured = text.split("\n\n")[0]
    assert "H200" in measured.splitlines()[0]
    line = re.search(r"^3 x 256, 64 px, float32, +128: (.+)$", measured, re.MULTILINE)
    alone = float(line[1].split(";")[4])
    assert f"128 trainings of the size of `released` is {alone:.1f} times" in page
    apart = float(re.search(r"differ by at most (\S+),", measured)[1])
    assert f"differ there by up to {apart:.1%}".replace("%", " %") in page
    together = int(re.search(r"(\d+) samples/s; when", measured)[1])
    assert f"made {together:,} samples a second together" in page
    kernels = re.findall(r"(\d{5,}) /\s+(\d{5,}) samples/s", measured.replace("# ", ""))
    of_two, of_eight = (int(after) / int(before) for before, after in kernels)
    assert f"recipe R are {of_two:.1f} times as fast as before" in page
    assert f"16 trainings with batches of 8 are {of_eight:.1f} times as fast" in page


@pytest.mark.more
def test_the_python_of_ones_own_robot_runs(tmp_path, monkeypatch, capsys):
    """Blocks run in the page's order: later ones use names of earlier ones."""
    code = "\n".join(blocks(source(OWN_ROBOT), "python"))
    for words, smaller in SMALLER_PYTHON.items():
        code, count = re.subn(words, smaller, code)
        assert count, words
    for robot in ("warthog", "husky"):
        shutil.copy(ROOT / "recordings" / f"{robot}.csv.gz", tmp_path)
    shutil.copy(ROOT / "recordings" / "skid_steer.yaml", tmp_path / "robot.yaml")
    small = {"max_samples": 4000, "hidden": 16, "pixels": 8}
    monkeypatch.setattr(learning, "SETTINGS", learning.SETTINGS.with_values(small))
    monkeypatch.chdir(tmp_path)
    made = {}
    exec(code, made)  # noqa: S102 - the page's own
    assert re.match(r"loss [\d.]+ ± .* drives of", capsys.readouterr().out)
    assert made["path"].shape[1] == 13 and made["steps"].shape[0] > 1000
    assert made["info"] is not None and (tmp_path / "model").is_dir()
