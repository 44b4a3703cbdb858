"""Trials and their data in one file, run on another machine in limited time."""

import dataclasses
import itertools
from types import SimpleNamespace

import pytest

import companion.engine.run as running
from companion import Results, run
from companion.__main__ import main
from companion.bundle import bundle as bundled
from companion.bundle import training as bundle_training
from companion.engine.pack import pack, unpack
from companion.engine.run import checkpoint_folder
from sidm.config import ConfigError
from sidm.shards import ShardError

pytestmark = pytest.mark.more


@pytest.fixture
def trials(study):
    """Both methods and fine-tuning, each long enough to be stopped on its way."""
    trials = study.figure3("system1")[:3]
    caps = dict(max_samples=20_000, patience=20_000)
    return [t.replace(training=dataclasses.replace(t.training, **caps)) for t in trials]


def test_a_pack_holds_what_trials_need_and_no_more(trials, data, tmp_path):
    file = tmp_path / "pack.tar"
    assert pack(trials, file, data) == trials
    elsewhere = tmp_path / "elsewhere"
    assert unpack(file, elsewhere) == trials == unpack(file, elsewhere)
    for dataset in trials[0].datasets.values():
        for path in dataset.collection.folder(elsewhere).glob("shard-*"):
            assert (
                path.read_bytes()
                == (dataset.collection.folder(data) / path.name).read_bytes()
            )
    assert not list(elsewhere.rglob("maps-*"))
    assert not (elsewhere / "trials.json").exists()


def test_the_limit_leaves_out_what_has_no_room(trials, data, tmp_path):
    both = [trials[0], trials[0].replace(system="system2", novice_data="x")]
    with pytest.raises(
        ShardError, match=r"system2.* is missing; 'companion collect' makes it"
    ):
        pack(both, tmp_path / "pack.tar", data)
    assert pack(trials, tmp_path / "pack.tar", data, limit=1) == trials
    assert (tmp_path / "pack.tar").stat().st_size < 2**20
    with pytest.raises(ConfigError, match=r"no trial's data fit into 0.01 MiB"):
        pack(trials, tmp_path / "pack.tar", data, limit=0.01)


def test_what_is_no_pack_is_refused_in_one_line(tmp_path):
    with pytest.raises(
        ConfigError, match="there is no pack '.*pack.tar'; 'companion pack' writes one"
    ):
        unpack(tmp_path / "pack.tar", tmp_path)
    (tmp_path / "pack.tar").write_bytes(b"something else")
    with pytest.raises(ConfigError, match="is no pack"):
        unpack(tmp_path / "pack.tar", tmp_path)


def test_stopped_by_the_clock_and_gone_on_with(trials, data, tmp_path, monkeypatch):
    """Several calls with too little time give what one call gives.

    Pretraining is stopped, too.
    """
    pack(trials, tmp_path / "pack.tar", data)
    whole = run(trials, data=data, results=tmp_path / "whole", progress=False, bundle=3)
    elsewhere, store, calls = tmp_path / "data", Results(tmp_path / "parts"), 0
    packed = unpack(tmp_path / "pack.tar", elsewhere)
    ticks = itertools.count()
    # a fake clock, so that no test has to wait
    clock = SimpleNamespace(monotonic=lambda: float(next(ticks)))
    for module in (running, bundle_training, bundled):
        monkeypatch.setattr(module, "time", clock)
    while store.missing(packed):
        run(
            packed,
            data=elsewhere,
            results=store,
            progress=False,
            bundle=3,
            seconds=25.0,
        )
        calls += 1
        assert calls < 50
    assert calls > 3
    for one, other in zip(store.rows(packed), whole.rows(trials), strict=True):
        assert one.outcome.samples == other.outcome.samples
        assert one.outcome.every_test_loss == pytest.approx(
            other.outcome.every_test_loss, rel=1e-5
        )
        assert one.outcome.validation_loss == pytest.approx(
            other.outcome.validation_loss, rel=1e-5
        )
        assert not checkpoint_folder(elsewhere, one.trial, "bundle").exists()
    assert any(row.provenance.resumed for row in store.rows(packed))


def test_killed_in_the_middle_it_goes_on_from_its_states(
    trials, data, tmp_path, monkeypatch
):
    trial = trials[1]

    class Killed(Exception):
        pass

    phases, phase = itertools.count(), bundled.Bundle.phase

    def until_killed(self, progress=None):
        if next(phases) == 4:
            raise Killed
        return phase(self, progress)

    monkeypatch.setattr("companion.bundle.training.SAVE_INTERVAL", 0.0)
    with monkeypatch.context() as patch:
        patch.setattr(bundled.Bundle, "phase", until_killed)
        with pytest.raises(Killed):
            run([trial], data=data, results=tmp_path / "a", progress=False, bundle=1)
    assert checkpoint_folder(data, trial, "bundle").exists()
    repeated = run(
        [trial], data=data, results=tmp_path / "a", progress=False, bundle=1
    ).rows([trial])[0]
    whole = run(
        [trial], data=data, results=tmp_path / "b", progress=False, bundle=1
    ).rows([trial])[0]
    assert repeated.provenance.resumed and repeated.outcome == whole.outcome


def test_seconds_are_a_bundles(trials, data, tmp_path):
    with pytest.raises(ConfigError, match="seconds are those of a bundle"):
        run(trials, data=data, results=tmp_path, seconds=5.0)


def test_the_commands(study, trials, data, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("companion.commands._trials", lambda *_: trials)
    file, places = (
        tmp_path / "pack.tar",
        ["--data", str(data), "--results", str(tmp_path)],
    )
    assert main(["pack", str(file), "--preset", "smoke", *places]) == 0
    assert "3 of 3 missing trials" in capsys.readouterr().out
    there = ["--data", str(tmp_path / "data"), "--results", str(tmp_path / "found")]
    assert (
        main(["run", "--pack", str(file), "--bundle", "3", "--device", "cpu", *there])
        == 0
    )
    assert "3 of 3 trials stored" in capsys.readouterr().out
    assert main(["merge", str(tmp_path / "found"), "--results", str(tmp_path)]) == 0
    assert main(["pack", str(file), "--preset", "smoke", *places]) == 2
    assert "no trial's data fit" in capsys.readouterr().err
