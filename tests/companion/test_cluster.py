"""A real Dask cluster on this machine.

One of its workers is killed, and one is added later.
"""

import json
import subprocess
import sys
import time
from pathlib import Path

import pytest

from companion import Results, Study, load_preset
from companion.__main__ import main
from companion.cluster import executor_at
from companion.tasks.run import records
from sidm.shards import digest
from sidm.simulation import collect
from tests.companion.test_crash import SETTINGS

pytestmark = pytest.mark.more


def begin(what: str, *words: str) -> subprocess.Popen:
    """A process of a Dask cluster, a scheduler or a worker."""
    command = [sys.executable, "-m", f"distributed.cli.dask_{what}", *words]
    quiet = subprocess.DEVNULL
    return subprocess.Popen([*command, "--no-dashboard"], stdout=quiet, stderr=quiet)


def worker(address: str, folder: Path) -> subprocess.Popen:
    local = f"--local-directory {folder / 'dask'} --nthreads 1 --no-nanny"
    return begin("worker", address, *local.split())


@pytest.fixture
def cluster(tmp_path):
    """Address of the scheduler, and processes of the scheduler and two workers."""
    file = tmp_path / "scheduler.json"
    words = f"--host 127.0.0.1 --port 0 --scheduler-file {file}"
    scheduler = begin("scheduler", *words.split())
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
    common = f"--preset smoke --system system1 --data {tmp_path / 'data'}".split()
    for name, value in SETTINGS.items():
        common += ["--set", f"{name}={value}"]
    there, here = (["--results", str(tmp_path / name)] for name in ("there", "here"))
    assert main(["collect", *common, *there, "--dask", address]) == 0
    digests = capsys.readouterr().out

    put, victim = Results.put, processes[1]

    def put_and_disturb(*row):
        put(*row)
        if victim.poll() is None:  # while others are at work
            victim.kill()
            victim.wait()
            processes.append(worker(address, tmp_path))

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Results, "put", put_and_disturb)
        assert main(["run", *common, *there, "--dask", address]) == 0
    assert victim.wait() < 0 and len(processes) == 4
    assert main(["run", *common, *here]) == 0
    preset = load_preset("smoke", **SETTINGS)
    trials = Study(preset).figure3("system1")
    rows = [
        [row.outcome for row in Results(tmp_path / name).stored(trials)]
        for name in ("there", "here")
    ]
    assert rows[0] == rows[1] and len(rows[0]) == 6
    found = preset.datasets("system1")["validation"]
    alone = collect(tmp_path / "alone", found.collection, found.count, workers=1)
    assert f"{found.name}: {digest(alone)}" in digests


def test_without_a_scheduler_or_dask_it_says_so(monkeypatch):
    monkeypatch.setattr("companion.cluster.TIMEOUT", "300ms")
    with pytest.raises(
        OSError, match=r":1: no Dask scheduler answers there \([^\n]*\)$"
    ):
        executor_at("tcp://127.0.0.1:1").__enter__()
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(ImportError, match="pip install distributed"):
        executor_at("tcp://127.0.0.1:1").__enter__()


def test_the_benchmark_runs_on_a_cluster(cluster, tmp_path, capsys):
    task = ["--tasks", "husky to warthog, 0.8 min", "--seeds", "1"]
    losses = []
    for place, dask in (("there", ["--dask", cluster[0]]), ("here", [])):
        results = tmp_path / place
        words = ["bench", "mean", *task, "--results", str(results), *dask]
        assert main(words) == 0
        (row,) = records(results).all()
        losses.append((row.about, row.status, row.loss, row.position))
    assert losses[0] == losses[1] and losses[0][1] == "ok"
