"""A real Dask cluster on this machine.

One of its workers is killed, and one is added later.
"""

import contextlib
import importlib
import json
import subprocess
import sys
import time
from pathlib import Path

import pytest
from crash import SETTINGS

from companion import Results, Study, load_preset
from companion.__main__ import main
from companion.cluster import dask_executor
from companion.tasks.run import records
from sidm.shards import digest
from sidm.simulation import collect

pytestmark = pytest.mark.more


def start(*words: str) -> subprocess.Popen:
    return subprocess.Popen(
        [sys.executable, "-m", *words],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )


def worker(address: str, folder: Path) -> subprocess.Popen:
    local = (
        f"--local-directory {folder / 'dask'} --no-dashboard --nthreads 1 --no-nanny"
    ).split()
    return start("distributed.cli.dask_worker", address, *local)


@pytest.fixture
def cluster(tmp_path):
    """Address of the scheduler, and processes of the scheduler and two workers.

    More workers may be added.
    """
    file = tmp_path / "scheduler.json"
    scheduler = start(
        "distributed.cli.dask_scheduler",
        "--host",
        "127.0.0.1",
        "--port",
        "0",
        "--no-dashboard",
        "--scheduler-file",
        str(file),
    )
    processes = [scheduler]
    try:
        while not file.exists() or not file.read_text().strip():
            assert scheduler.poll() is None
            time.sleep(0.05)
        address = json.loads(file.read_text())["address"]
        processes += (worker(address, tmp_path) for _ in range(2))
        yield address, processes
    finally:
        for process in processes:
            process.kill()
            process.wait()


def test_a_cluster_gives_what_this_machine_gives(cluster, tmp_path, capsys):
    """Collection and training give the same to the last bit.

    One worker is killed at work, and another is added.
    """
    address, processes = cluster
    changes = [
        word
        for name, value in SETTINGS.items()
        for word in ("--set", f"{name}={value}")
    ]
    common = [
        *f"--preset smoke --system system1 --data {tmp_path / 'data'}".split(),
        *changes,
    ]
    there, here = (["--results", str(tmp_path / name)] for name in ("there", "here"))
    assert main(["collect", *common, *there, "--dask", address]) == 0
    digests = capsys.readouterr().out

    # the package has a function of that name
    module = importlib.import_module("companion.engine.run")
    keep, victim = module._Runner.store_result, processes[1]

    def keep_and_disturb(*row):
        keep(*row)
        if victim.poll() is None:  # while others are at work
            victim.kill()
            victim.wait()
            processes.append(worker(address, tmp_path))

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module._Runner, "store_result", keep_and_disturb)
        assert main(["run", *common, *there, "--dask", address]) == 0
    assert victim.wait() < 0 and len(processes) == 4
    assert main(["run", *common, *here]) == 0
    trials = Study(
        load_preset("smoke", **SETTINGS), tmp_path / "data", tmp_path / "here"
    ).figure3("system1")
    rows = [
        [row.outcome for row in Results(tmp_path / name).rows(trials)]
        for name in ("there", "here")
    ]
    assert rows[0] == rows[1] and len(rows[0]) == 6

    dataset = load_preset("smoke", **SETTINGS).datasets("system1")["validation"]
    alone = collect(
        tmp_path / "alone", dataset.collection, dataset.count, workers=1, progress=False
    )
    assert f"{dataset.name}: {digest(alone)}" in digests


def test_no_scheduler_is_one_line(monkeypatch):
    monkeypatch.setattr("companion.cluster.TIMEOUT", "300ms")
    with pytest.raises(
        OSError, match="tcp://127.0.0.1:1: no Dask scheduler answers there"
    ) as caught:
        with dask_executor("tcp://127.0.0.1:1"):
            pass
    assert "\n" not in str(caught.value)


def test_without_dask_it_says_so(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with (
        pytest.raises(ImportError, match="pip install distributed"),
        contextlib.ExitStack() as stack,
    ):
        stack.enter_context(dask_executor("tcp://127.0.0.1:1"))


def test_the_benchmark_runs_on_a_cluster(cluster, tmp_path, capsys):
    """The rows of a method are those that this machine gives."""
    task = ["--tasks", "husky to warthog, 0.8 min", "--seeds", "1"]
    losses = []
    for place, dask in (("there", ["--dask", cluster[0]]), ("here", [])):
        results = tmp_path / place
        words = ["bench", "mean", *task, "--results", str(results), *dask]
        assert main(words) == 0
        (row,) = records(results).all()
        losses.append((row.about, row.status, row.loss, row.position))
    assert losses[0] == losses[1] and losses[0][1] == "ok"
