"""The command line: its output and its exit status."""

import pkgutil
import signal
import subprocess
import sys
import time
import tomllib
from pathlib import Path

import pytest

from companion.__main__ import main
from companion.registry import NAMES
from ownrobot.__main__ import main as ownrobot_main
from sidm.shards import read_shard
from sidm.systems import SYSTEMS

ROOT = Path(__file__).parents[2]

HEAVY = "{'torch', 'pybullet', 'scipy'}"


def python(*words) -> subprocess.CompletedProcess:
    command = [sys.executable, *map(str, words)]
    return subprocess.run(command, capture_output=True, text=True)


def test_the_command_is_the_module_and_its_import_is_light():
    """Neither PyTorch, PyBullet, SciPy nor NumPy is imported."""
    scripts = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["scripts"]
    found = {name: pkgutil.resolve_name(target) for name, target in scripts.items()}
    assert found == {"ownrobot": ownrobot_main, "companion": main}
    code = "import sys, ownrobot.__main__, companion.__main__; "
    code += f"print(({HEAVY} | {{'numpy'}}) & set(sys.modules))"
    assert python("-c", code).stdout.strip() == "set()"
    result = python("-m", "companion", "shwo")
    assert result.stderr.endswith("did you mean 'show'? see companion --help\n")
    assert result.returncode == 2


def test_showing_what_is_stored_is_light():
    code = "import sys; from companion.__main__ import main; "
    code += "main(['show', '--results', sys.argv[1]]); "
    code += f"print({HEAVY} & set(sys.modules))"
    lines = python("-c", code, ROOT / "results").stdout.splitlines()
    assert lines[-1] == "set()" and "stored 3 of 3" in lines[1]


def test_without_pybullet_collecting_alone_is_an_error_of_one_line(tmp_path):
    code = "import sys; sys.modules['pybullet'] = None; "
    code += "from companion.__main__ import main; sys.exit(main(sys.argv[1:]))"
    shown = python("-c", code, "show", "--preset", "smoke", "--results", tmp_path)
    assert shown.returncode == 0 and shown.stdout.splitlines()[-1] == "missing: 12"
    collected = python("-c", code, "collect", "--preset", "smoke", "--data", tmp_path)
    assert collected.returncode == 1 and collected.stderr.count("\n") == 1
    assert "PyBullet" in collected.stderr


def test_help_names_every_figure_and_shows_defaults_and_units(capsys):
    with pytest.raises(SystemExit) as stop:
        main(["run", "--help"])
    assert stop.value.code == 0
    text = capsys.readouterr().out
    for words in ("minutes of motion", "(laptop)", "(data)"):
        assert words in text
    # lines break at hyphens, too
    assert f"{','.join(NAMES)}orall" in "".join(text.split())


@pytest.mark.parametrize(
    "words, message",
    [
        ("show --preset lapto", "did you mean 'laptop'?"),
        ("run --figure drivin", "did you mean 'driving'?"),
        ("show --set pixels", "--set takes NAME=VALUE, not 'pixels'"),
        ("show --set pixels=big", "'Network.pixels' must be int, not str ('big')"),
        ("show --minutes 3", "not in this grid; it has 1, 2, 5, 20, 60, 120"),
        ("show --methods sdim", "not in this grid; it has novice_only, pretrain"),
        ("run --preset smoke", "companion collect --preset"),  # no data
        ("run --workers 0", "--workers"),
        ("run --figure driving --minutes 5", "--minutes is for figures of trials"),
        ("show --figure gap --csv rows.csv", "--csv is for figures of trials"),
        ("show --figure gap --system system2", "--system is for figures of trials"),
        ("show --against nowhere", "nowhere: there is no such folder of results"),
        ("show --set more_seeds=[[5,0]]", "more_seeds must be from 1 to 1000"),
        ("collect --preset smoke --steps A1", "--steps are of a figure: name one"),
        ("bench --retry", "--retry is for methods that are run: name one"),
        ("bench mean --limit -5", "seconds must be above 0, not -5"),
    ],
)
def test_arguments_that_cannot_be_used(words, message, capsys, tmp_path):
    """Bad arguments give exit status 2 and one line on stderr."""
    folders = ["--data", str(tmp_path), "--results", str(tmp_path)]
    try:
        status = main([*words.split(), *folders])
    except SystemExit as stop:  # argparse
        status = stop.code
    errors = capsys.readouterr().err
    assert status == 2 and message in errors
    assert errors.startswith("companion") and errors.count("\n") == 1


@pytest.mark.parametrize(
    ("words", "count"),
    [
        ("--figure 4", 60),
        ("--system system2 --minutes 5 20 --seeds 0", 6),
        ("--minutes 5 --seeds 0 --methods sidm novice_only", 4),
    ],
)
def test_show_counts_what_is_missing(words, count, tmp_path, capsys):
    assert main(["show", *words.split(), "--results", str(tmp_path)]) == 0
    assert capsys.readouterr().out.splitlines()[-1] == f"missing: {count}"


@pytest.mark.more
def test_ctrl_c_leaves_a_state_to_go_on_from(tmp_path):
    """A stopped collection says how to go on, and its workers end with it."""
    pytest.importorskip("pybullet")
    words = f"collect --preset smoke --system system1 --data {tmp_path} --workers 2"
    process = subprocess.Popen(
        [sys.executable, "-m", "companion", *words.split()],
        stderr=subprocess.PIPE,
        text=True,
        # a process in the background ignores the signal by default
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    while process.poll() is None and not list(tmp_path.rglob("shard-*.npz")):
        time.sleep(0.05)
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=600)
    assert process.returncode == 1 and "Traceback" not in errors
    assert errors.splitlines()[-1] == (
        "companion: stopped; the same command goes on where this one was"
    )
    terrain = SYSTEMS["system1"].terrain
    for path in tmp_path.rglob("shard-*.npz"):
        assert len(read_shard(path, terrain)) == 4
