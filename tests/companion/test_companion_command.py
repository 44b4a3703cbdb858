"""The command line: its output and its exit status."""

import importlib
import pkgutil
import signal
import subprocess
import sys
import time
import tomllib
from pathlib import Path

import pytest

from companion import Results, Study, grid, load_preset
from companion.__main__ import main
from companion.registry import NAMES
from ownrobot.__main__ import main as ownrobot_main
from sidm.shards import read_shard
from sidm.systems import SYSTEMS

ROOT = Path(__file__).parents[2]

CHANGES = {
    "expert_minutes": 0.25,
    "novice_minutes_system1": [0.25],
    "pool_minutes_system1": 0.25,
    "validation_minutes": 0.25,
    "rollouts": 2,
    "pixels": 8,
    "hidden": 8,
    "max_samples": 2000,
    "figure4_minutes": [0.25],
}


def python(code: str, *words: str) -> subprocess.CompletedProcess:
    return subprocess.run(
        [sys.executable, "-c", code, *words], capture_output=True, text=True
    )


def test_importing_the_packages_is_light():
    """A package and its command's help import neither PyTorch, PyBullet nor NumPy."""
    code = "import sys, ownrobot.__main__, companion.__main__; "
    code += "print({'torch', 'pybullet', 'scipy', 'numpy'} & set(sys.modules))"
    assert python(code).stdout.strip() == "set()"


def test_the_command_is_the_module():
    """`companion` and `python -m companion` are the same, also by their name."""
    scripts = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["scripts"]
    assert {name: pkgutil.resolve_name(target) for name, target in scripts.items()} == {
        "ownrobot": ownrobot_main,
        "companion": main,
    }
    result = subprocess.run(
        [sys.executable, "-m", "companion", "show", "--help"],
        capture_output=True,
        text=True,
    )
    assert result.stdout.startswith("usage: companion show ") and result.returncode == 0
    result = subprocess.run(
        [sys.executable, "-m", "companion", "shwo"], capture_output=True, text=True
    )
    assert (
        result.stderr.endswith("did you mean 'show'? see companion --help\n")
        and result.returncode == 2
    )


def test_showing_what_is_stored_is_light():
    """Results are listed without PyTorch, whose import takes longer than reading."""
    code = "import sys; from companion.__main__ import main; "
    code += "main(['show', '--figure', 'all', '--results', sys.argv[1]]); "
    code += "print({'torch', 'pybullet', 'scipy'} & set(sys.modules))"
    lines = python(code, str(ROOT / "results")).stdout.splitlines()
    assert lines[-1] == "set()" and "stored 3 of 3" in lines[1]


def test_without_pybullet(tmp_path):
    """Experiments run without PyBullet; collecting is then an error of one line."""
    hide = (
        "import sys; sys.modules['pybullet'] = None; "
        "import companion; from companion.__main__ import main; "
    )
    arguments = ["show", "--preset", "smoke", "--results", str(tmp_path)]
    result = python(hide + "sys.exit(main(sys.argv[1:]))", *arguments)
    assert result.returncode == 0 and result.stdout.splitlines()[-1] == "missing: 12"
    arguments = ["collect", "--preset", "smoke", "--data", str(tmp_path)]
    result = python(hide + "sys.exit(main(sys.argv[1:]))", *arguments)
    assert result.returncode == 1
    assert result.stderr.count("\n") == 1
    assert "PyBullet" in result.stderr


def test_help_shows_defaults_and_units(capsys):
    for command in ("collect", "train", "run", "show", "notebook"):
        with pytest.raises(SystemExit) as stop:
            main([command, "--help"])
        assert stop.value.code == 0
    with pytest.raises(SystemExit):
        main(["train", "--help"])
    output = capsys.readouterr().out
    assert "minutes of motion" in output and "(laptop)" in output and "(data)" in output


def test_help_names_every_figure(capsys):
    with pytest.raises(SystemExit):
        main(["run", "--help"])
    message = "".join(capsys.readouterr().out.split())  # lines break at hyphens, too
    assert f"{','.join(NAMES)}orall" in message


@pytest.mark.parametrize(
    "words, message",
    [
        (["show", "--preset", "lapto"], "did you mean 'laptop'?"),
        (["run", "--figure", "drivin"], "did you mean 'driving'?"),
        (
            ["show", "--figure", "experts"],
            "figure 'experts' is called 'several-experts' now",
        ),
        (["show", "--set", "pixel=3"], "did you mean 'pixels'?"),
        (["show", "--set", "pixels"], "--set takes NAME=VALUE, not 'pixels'"),
        (
            ["show", "--set", "pixels=big"],
            "'Network.pixels' must be int, not str ('big')",
        ),
        (
            ["show", "--minutes", "3"],
            "minutes 3 is not in this grid; it has 1, 2, 5, 20, 60, 120",
        ),
        (["run", "--figure", "5"], "unknown figure '5'"),
        (
            ["train", "--system", "system1", "--minutes", "500"],
            "at most pool_minutes (120), not 500",
        ),
        (
            ["train", "--system", "system1", "--minutes", "5", "--method", "sdim"],
            "did you mean 'sidm'?",
        ),
    ],
)
def test_arguments_that_cannot_be_used(words, message, capsys, tmp_path):
    """Bad arguments give exit status 2 and one line on stderr."""
    assert main([*words, "--data", str(tmp_path), "--results", str(tmp_path)]) == 2
    errors = capsys.readouterr().err
    assert (
        errors.startswith("companion: ")
        and message in errors
        and errors.count("\n") == 1
    )


@pytest.mark.parametrize(
    "words", [["show", "--sytem", "system1"], ["train"], ["run", "--workers", "0"], []]
)
def test_argparse_errors(words):
    with pytest.raises(SystemExit) as stop:
        main(words)
    assert stop.value.code == 2


def test_show_counts(tmp_path, capsys):
    """The last line is 'missing: N', for the figure or the chosen part of it."""
    common = ["--data", str(tmp_path), "--results", str(tmp_path)]
    for words, count in (
        (["--preset", "laptop"], 108),
        (["--preset", "paper"], 480),
        (["--preset", "laptop", "--figure", "4"], 60),
        (
            "--preset laptop --system system2 --minutes 5 20 --seeds 0".split(),
            6,
        ),
        (["--preset", "laptop", "--set", "seeds=1"], 36),
        (["--preset", "laptop", "--figure", "all"], len(grid("laptop", "all"))),
    ):
        assert main(["show", *words, *common]) == 0
        assert capsys.readouterr().out.splitlines()[-1] == f"missing: {count}"


def test_damaged_store_is_one_line(tmp_path, capsys):
    """A row that cannot be read is named, with exit status 1."""
    path = Results(tmp_path).lines.path
    path.write_text("{\n")
    places = ["--data", str(tmp_path), "--results", str(tmp_path)]
    assert main(["show", "--preset", "smoke", *places]) == 1
    errors = capsys.readouterr().err
    assert str(path) in errors and errors.count("\n") == 1


def test_missing_data_is_one_line(tmp_path, capsys):
    """Nothing runs on missing data; the message names the command that makes them."""
    places = ["--data", str(tmp_path), "--results", str(tmp_path)]
    assert main(["run", "--preset", "smoke", *places]) == 2
    assert "companion collect --preset" in capsys.readouterr().err


@pytest.mark.more
def test_collect_train_run_show(tmp_path, capsys):
    """Collect, run one trial and then the rest, with the real simulator."""
    pytest.importorskip("pybullet")
    settings = [
        word for name, value in CHANGES.items() for word in ("--set", f"{name}={value}")
    ]
    data, results = str(tmp_path / "data"), str(tmp_path / "results")
    common = ["--preset", "smoke", "--data", data, "--results", results, *settings]
    part = ["--system", "system1"]
    assert main(["collect", *common, *part, "--workers", "2"]) == 0
    assert len(capsys.readouterr().out.splitlines()) == 4
    assert (
        main(["train", *common, *part, "--minutes", "0.25", "--method", "novice_only"])
        == 0
    )
    assert "validation loss" in capsys.readouterr().out
    assert main(["show", *common, *part]) == 0
    assert capsys.readouterr().out.splitlines()[-1] == "missing: 2"
    assert main(["run", *common, *part, "--workers", "1"]) == 0
    assert "3 of 3 trials stored" in capsys.readouterr().out
    trials = Study(
        load_preset("smoke", **CHANGES), tmp_path / "data", tmp_path / "results"
    ).figure3("system1")
    assert [
        row.provenance.stale for row in Results(tmp_path / "results").rows(trials)
    ] == [False] * 3


def test_damaged_checkpoint_is_one_line(tmp_path, capsys, monkeypatch):
    """An error of training reaches the command line as one line, with exit status 1."""
    from sidm.learning import CheckpointError

    def damaged(*_, **__):
        raise CheckpointError(
            "checkpoint.npz: the checkpoint is damaged (x); delete it to start afresh"
        )

    monkeypatch.setattr(
        importlib.import_module("companion.engine.run"), "run_here", damaged
    )
    arguments = (
        f"train --preset smoke --system system1 --minutes 0.5 --results {tmp_path}"
    ).split()
    assert main(arguments) == 1
    message = (
        "companion: checkpoint.npz: the checkpoint is damaged (x); "
        "delete it to start afresh\n"
    )
    assert capsys.readouterr().err == message


@pytest.mark.more
def test_ctrl_c_leaves_a_state_to_go_on_from(tmp_path):
    """A stopped collection says how to go on, and its workers end with it."""
    pytest.importorskip("pybullet")
    arguments = (
        f"collect --preset smoke --system system1 --data {tmp_path} --workers 2"
    ).split()
    process = subprocess.Popen(
        [sys.executable, "-m", "companion", *arguments],
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
    assert (
        errors.splitlines()[-1]
        == "companion: stopped; the same command goes on where this one was"
    )
    terrain = SYSTEMS["system1"].terrain
    assert all(
        len(read_shard(path, terrain)) == 4 for path in tmp_path.rglob("shard-*.npz")
    )
