"""The command line: what it prints and its exit status."""

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
from sidm.__main__ import main as library
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


def test_importing_either_package_is_light():
    """Neither PyTorch nor PyBullet nor an array comes with a package or with the
    command line's help."""
    code = "import sys, sidm.__main__, companion.__main__; "
    code += "print({'torch', 'pybullet', 'scipy', 'numpy'} & set(sys.modules))"
    assert python(code).stdout.strip() == "set()"


def test_the_command_is_the_module():
    """`companion` is what `python -m companion` is, and both say `companion`."""
    scripts = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["scripts"]
    assert {name: pkgutil.resolve_name(target) for name, target in scripts.items()} == {
        "sidm": library,
        "companion": main,
    }
    done = subprocess.run(
        [sys.executable, "-m", "companion", "show", "--help"],
        capture_output=True,
        text=True,
    )
    assert done.stdout.startswith("usage: companion show ") and done.returncode == 0
    done = subprocess.run(
        [sys.executable, "-m", "companion", "shwo"], capture_output=True, text=True
    )
    assert done.stderr.endswith("; see companion --help\n") and done.returncode == 2


def test_showing_what_is_stored_is_light():
    """All of it is listed without PyTorch, which takes longer to import than all the
    rows to read."""
    code = "import sys; from companion.__main__ import main; "
    code += "main(['show', '--figure', 'all', '--results', sys.argv[1]]); "
    code += "print({'torch', 'pybullet', 'scipy'} & set(sys.modules))"
    said = python(code, str(ROOT / "results")).stdout.splitlines()
    assert said[-1] == "set()" and "stored 3 of 3" in said[1]


def test_without_pybullet(tmp_path):
    """Experiments work where PyBullet is not installed; collecting says so in one
    line."""
    hide = "import sys; sys.modules['pybullet'] = None; import companion; from companion.__main__ import main; "
    done = python(
        hide + "sys.exit(main(sys.argv[1:]))",
        "show",
        "--preset",
        "smoke",
        "--results",
        str(tmp_path),
    )
    assert done.returncode == 0 and done.stdout.splitlines()[-1] == "missing: 12"
    done = python(
        hide + "sys.exit(main(sys.argv[1:]))",
        "collect",
        "--preset",
        "smoke",
        "--data",
        str(tmp_path),
    )
    assert (
        done.returncode == 1
        and done.stderr.count("\n") == 1
        and "PyBullet" in done.stderr
    )


def test_help_shows_defaults_and_units(capsys):
    for command in ("collect", "train", "run", "show", "notebook"):
        with pytest.raises(SystemExit) as stop:
            main([command, "--help"])
        assert stop.value.code == 0
    with pytest.raises(SystemExit):
        main(["train", "--help"])
    said = capsys.readouterr().out
    assert "minutes of motion" in said and "(laptop)" in said and "(data)" in said


def test_help_names_every_figure(capsys):
    with pytest.raises(SystemExit):
        main(["run", "--help"])
    said = "".join(capsys.readouterr().out.split())  # lines break at hyphens, too
    assert f"{','.join(NAMES)}orall" in said


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
        (["run", "--figure", "5"], "unknown parameter '5' of the figures"),
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
    """Exit status 2 and one line on stderr."""
    assert main([*words, "--data", str(tmp_path), "--results", str(tmp_path)]) == 2
    said = capsys.readouterr().err
    assert said.startswith("companion: ") and message in said and said.count("\n") == 1


@pytest.mark.parametrize(
    "words", [["show", "--sytem", "system1"], ["train"], ["run", "--workers", "0"], []]
)
def test_argparse_errors(words):
    with pytest.raises(SystemExit) as stop:
        main(words)
    assert stop.value.code == 2


def test_show_counts(tmp_path, capsys):
    """The last line is 'missing: N', over the figure or the part of it that is asked
    for."""
    common = ["--data", str(tmp_path), "--results", str(tmp_path)]
    for words, count in (
        (["--preset", "laptop"], 108),
        (["--preset", "paper"], 480),
        (["--preset", "laptop", "--figure", "4"], 60),
        (
            [
                "--preset",
                "laptop",
                "--system",
                "system2",
                "--minutes",
                "5",
                "20",
                "--seeds",
                "0",
            ],
            6,
        ),
        (["--preset", "laptop", "--set", "seeds=1"], 36),
        (["--preset", "laptop", "--figure", "all"], len(grid("laptop", "all"))),
    ):
        assert main(["show", *words, *common]) == 0
        assert capsys.readouterr().out.splitlines()[-1] == f"missing: {count}"


def test_damaged_store_is_one_line(tmp_path, capsys):
    """A row that cannot be read is named, with exit status 1."""
    trial = grid("smoke", data=tmp_path, results=tmp_path)[0]
    path = Results(tmp_path).path(trial)
    path.parent.mkdir()
    path.write_text("{")
    assert (
        main(
            [
                "show",
                "--preset",
                "smoke",
                "--data",
                str(tmp_path),
                "--results",
                str(tmp_path),
            ]
        )
        == 1
    )
    said = capsys.readouterr().err
    assert str(path) in said and said.count("\n") == 1


def test_missing_data_is_one_line(tmp_path, capsys):
    """Nothing is run on data that do not exist; the message names the command that
    makes them."""
    assert (
        main(
            [
                "run",
                "--preset",
                "smoke",
                "--data",
                str(tmp_path),
                "--results",
                str(tmp_path),
            ]
        )
        == 2
    )
    assert "companion collect --preset" in capsys.readouterr().err


def test_collect_train_run_show(tmp_path, capsys):
    """The whole way with the real simulator: collect, one trial, the rest, nothing
    missing."""
    pytest.importorskip("pybullet")
    settings = [
        word for name, value in CHANGES.items() for word in ("--set", f"{name}={value}")
    ]
    common = [
        "--preset",
        "smoke",
        "--data",
        str(tmp_path / "data"),
        "--results",
        str(tmp_path / "results"),
        *settings,
    ]
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
    """What training reports of itself reaches the command line as one line, with exit
    status 1."""
    from sidm.learning import CheckpointError

    def damaged(*_, **__):
        raise CheckpointError(
            "checkpoint.npz: the checkpoint is damaged (x); delete it to start afresh"
        )

    monkeypatch.setattr(
        importlib.import_module("companion.engine.run"), "run_here", damaged
    )
    words = [
        "train",
        "--preset",
        "smoke",
        "--system",
        "system1",
        "--minutes",
        "0.5",
        "--results",
        str(tmp_path),
    ]
    assert main(words) == 1
    said = "companion: checkpoint.npz: the checkpoint is damaged (x); delete it to start afresh\n"
    assert capsys.readouterr().err == said


def test_ctrl_c_leaves_a_state_to_go_on_from(tmp_path):
    """Stopped while it collects, a command says how to go on, and its workers end with
    it."""
    pytest.importorskip("pybullet")
    words = [
        "collect",
        "--preset",
        "smoke",
        "--system",
        "system1",
        "--data",
        str(tmp_path),
        "--workers",
        "2",
    ]
    process = subprocess.Popen(
        [sys.executable, "-m", "companion", *words],
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(
            signal.SIGINT, signal.SIG_DFL
        ),  # ignored by what runs in the background
    )
    while process.poll() is None and not list(tmp_path.rglob("shard-*.npz")):
        time.sleep(0.05)
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=600)
    assert process.returncode == 1 and "Traceback" not in said
    assert (
        said.splitlines()[-1]
        == "companion: stopped; the same command goes on where this one was"
    )
    terrain = SYSTEMS["system1"].terrain
    assert all(
        len(read_shard(path, terrain)) == 4 for path in tmp_path.rglob("shard-*.npz")
    )
