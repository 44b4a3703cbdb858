"""Real trials on tiny synthetic data, and the function that runs and stores them."""

import dataclasses
import shutil
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
import torch

from companion import Results, Study, perform, run, run_trial
from companion.__main__ import main
from companion.bodies import NOVICES
from companion.engine import known_motion
from companion.engine.datasets import digest_of, digests_of, is_here
from companion.engine.execute import stored_as
from companion.engine.library import Library
from companion.engine.records import ProvenanceTimer, one_line, rounded
from companion.engine.run import checkpoint_folder, run_here
from companion.numerics import versions
from companion.trials import motion_of
from sidm.config import ConfigError
from sidm.shards import SHARD_SIZE


@pytest.fixture
def trials(study):
    """SIDM and its comparison, at the smaller size."""
    return study.figure3("system1")[:2]


def outcomes(store, trials):
    """Outcomes without their times."""
    return [row.outcome for row in store.rows(trials)]


@pytest.mark.parametrize("method", ["sidm", "novice_only"])
def test_a_trial_end_to_end(study, data, method):
    """A trial trains, validates and rolls out; parts of the outcome agree."""
    trial = study.trial("system1", method, 0.75)
    row = run_trial(trial, data)
    out = row.outcome
    assert out.validation_loss == pytest.approx(sum(out.component_losses))
    assert out.validation_loss > 0
    assert len(out.component_losses) == 13
    assert len(out.position_error) == len(out.heading_error) == 25
    assert len(out.example_predicted) == len(out.example_actual) == 26
    assert out.example_predicted[0] == pytest.approx(out.example_actual[0])
    # whole batches
    assert out.iterations > 0 and 0 < out.samples < trial.training.max_samples + 8 * 64
    assert (
        len(out.curve_samples)
        == len(out.curve_test_loss)
        == len(out.curve_training_loss)
        <= 40
    )
    assert list(out.curve_samples) == sorted(set(out.curve_samples))
    assert out.curve_samples[-1] <= out.samples
    assert min(out.curve_test_loss) <= out.best_test_loss  # smoothed
    assert (
        len(out.component_samples)
        == len(out.component_test)
        == len(out.component_validation)
        > 1
    )
    assert sum(out.component_test[0]) == pytest.approx(out.curve_test_loss[0], rel=1e-5)
    # of a method without an adversary nothing is stored
    tests = len(out.every_test_loss) if method == "sidm" else 0
    assert len(out.every_test_loss) > 1
    for values in (out.every_discriminator_accuracy, out.every_matching_loss):
        assert len(values) == tests
        assert method == "novice_only" or values[-1] > 0
    # all that exist
    assert (
        np.shape(out.rollouts_predicted) == np.shape(out.rollouts_actual) == (2, 26, 13)
    )
    assert out.example_predicted == tuple(
        (state[0], state[1]) for state in out.rollouts_predicted[0]
    )
    assert row.provenance.threads == 1
    assert not row.provenance.resumed
    assert not row.provenance.stale


def test_another_bodys_losses_are_in_the_same_unit_for_every_seed(study, data):
    """Losses are divided by the variance of the validation data.

    The variance of the few trajectories that the model learnt from differs by seed.
    """
    network = dataclasses.replace(study.preset.network, novice_body=NOVICES["planar"])
    other_study = study.with_preset(dataclasses.replace(study.preset, network=network))
    for seed in (0, 1):
        trial = other_study.trial("system1", "novice_only", 0.75, seed)
        outcome, trained = perform(trial, data)
        motion = Library(data).motion(trial, "validation")
        with torch.inference_mode():
            off = (
                trained.model("novice", motion.inputs, motion.maps)[0] - motion.targets
            )
        spread = motion.targets.flatten(0, 1).std(0, correction=0)
        # components that stand still in the made-up motion have almost no variance
        moves = spread > 1e-3
        expected = off.square().mean((0, 1)) / spread.square()
        assert moves.sum() >= 4
        assert np.array(outcome.component_losses)[moves] == pytest.approx(
            expected[moves].numpy(), rel=1e-3
        )


def test_what_free_struts_did_depends_on_the_version_of_their_motion(study, make_row):
    made = make_row(study.trial("system1", "novice_only", 0.75))
    free = study.trial("system1_free_struts", "novice_only", 0.75)
    assert (
        "free_struts"
        not in stored_as(made.trial, made.outcome, made.provenance).provenance.numerics
    )
    assert stored_as(
        free, made.outcome, made.provenance
    ).provenance.numerics == made.provenance.numerics | versions("free_struts")


def test_a_trial_is_a_pure_function(trials, data):
    """A trial gives the same outcome to the last bit.

    It trains on one thread, whatever the caller uses.
    """
    threads = torch.get_num_threads()
    torch.manual_seed(1)
    first = perform(trials[0], data)[0]
    torch.manual_seed(2)
    assert perform(trials[0], data)[0] == first
    assert torch.get_num_threads() == threads


def test_run_skips_what_is_stored(trials, data, tmp_path, make_row):
    """Stored rows are left alone and others are run; a second run changes nothing."""
    store = Results(tmp_path)
    store.put(make_row(trials[0], loss=42.0))
    with ThreadPoolExecutor(1) as executor:
        assert (
            run(trials * 2, executor, data=data, results=store, progress=False) is store
        )
        assert store.missing(trials) == []
        assert store.get(trials[0]).outcome.validation_loss == 42.0
        files = {path: path.stat().st_mtime_ns for path in tmp_path.iterdir()}
        run(trials, executor, data=data, results=store, progress=False)
    assert files == {path: path.stat().st_mtime_ns for path in tmp_path.iterdir()}
    assert not checkpoint_folder(data, trials[1]).exists()
    expert = trials[1].datasets["expert"]
    noted = known_motion.read(tmp_path)[expert.name]
    assert noted.likeness and noted.digest == digest_of(expert, data)
    seen = store.get(trials[1]).provenance.digests
    assert seen == digests_of(trials[1], data) and seen[expert.name] == noted.digest
    assert any(name.endswith("/9, 0.25 min, seed 0") for name in seen)


@pytest.mark.more
def test_local_processes_agree_with_this_one(trials, data, tmp_path):
    """Worker processes store what this process gives, for one trial and for several."""
    store = run(trials[:2], workers=2, data=data, results=tmp_path, progress=False)
    in_turn = run(
        trials[:2], workers=1, data=data, results=tmp_path / "in turn", progress=False
    )
    assert (
        outcomes(store, trials[:2])
        == outcomes(Results(tmp_path), trials[:2])
        == outcomes(in_turn, trials[:2])
    )
    here = run_here(trials[0], data, tmp_path / "other")
    there = store.get(trials[0])
    assert rounded(here.outcome.position_error) == list(there.outcome.position_error)
    assert rounded(here.outcome.validation_loss) == there.outcome.validation_loss


def test_a_killed_trial_goes_on(trials, data, tmp_path):
    """A trial stopped in training resumes from its checkpoint to the same outcome."""
    trial, folder = trials[0], tmp_path / "checkpoint"
    whole = perform(trial, data)[0]

    class Killed(Exception):
        pass

    def kill(*_):
        if any(folder.rglob("*")):
            raise Killed

    with pytest.raises(Killed):
        run_trial(trial, data, folder, progress=kill)
    row = run_trial(trial, data, folder)
    assert row.provenance.resumed and row.outcome == whole


def test_one_failure_loses_no_other(trials, data, tmp_path, capsys, monkeypatch):
    """A trial that fails is reported in one line, and the other one is stored."""

    def fail_first(trial, *arguments, **options):
        if trial == trials[0]:
            raise OSError("no space left")
        return run_trial(trial, *arguments, **options)

    monkeypatch.setattr("companion.engine.run.run_trial", fail_first)
    store = run(trials, workers=1, data=data, results=tmp_path, progress=False)
    assert store.missing(trials) == trials[:1]
    errors = capsys.readouterr().err.strip()
    assert errors == "companion: system1 sidm 0.25 min seed 0: no space left"


def test_missing_data_name_the_command(tiny, tmp_path):
    """Without data nothing runs; the message says how to make them."""
    trials = Study(tiny, tmp_path, tmp_path).figure3("system1")
    words = r"the dataset system1/.* is not under .*; 'companion collect --preset"
    with pytest.raises(ConfigError, match=words):
        run(trials, data=tmp_path, results=tmp_path)
    with pytest.raises(ConfigError, match="workers must be at least 1"):
        run([], workers=0, data=tmp_path, results=tmp_path)


def test_a_trial_needs_what_it_draws_from_the_pool(trials, data, tmp_path):
    """Without the rest of the pool it learns the same."""
    trial = trials[0]
    needed, own = motion_of([trial]), tmp_path / "data"
    pool = trial.datasets["novice"]
    assert len(needed[pool]) == 2 and len(needed[trial.datasets["expert"]]) == 9
    shutil.copytree(data, own, ignore=shutil.ignore_patterns("maps-*"))
    kept = {index // SHARD_SIZE for index in needed[pool]}
    for number in {0, 1, 2} - kept:
        pool.collection.shard(own, number).unlink()
    assert not is_here(pool, own) and is_here(pool, own, needed[pool])
    row, whole = run_trial(trial, own), run_trial(trial, data)
    assert row.outcome == whole.outcome
    assert row.provenance.digests == whole.provenance.digests


def test_errors_in_one_line():
    """The type of an error is named where its message alone says too little."""
    assert one_line(ValueError("what\nwhere")) == "what"
    assert one_line(KeyError("a")) == "KeyError: 'a'"
    assert one_line(RuntimeError()) == "RuntimeError"


def test_data_made_again_elsewhere_stand_for_those_of_the_results(
    tiny, data, tmp_path, capsys, monkeypatch
):
    """Results of rounded motion join the others; results of other motion do not."""
    results, expert = tmp_path / "results", tiny.datasets("system1")["expert"]
    here = digest_of(expert, data)
    known_motion.compare(expert, data, results)
    first = known_motion.read(results)[expert.name]
    known_motion.note([dataclasses.replace(first, digest="elsewhere")], results)
    monkeypatch.setattr("companion.commands._preset", lambda _: tiny)
    arguments = f"collect --system system1 --data {data} --results {results} --verify"
    assert main(arguments.split()) == 0
    said = capsys.readouterr().out
    assert said.count("stands for the data of the results") == 1
    assert said.count("not compared, since no results are made with it") == 3
    assert known_motion.read(results)[expert.name].digests == ("elsewhere", here)
    (trial,) = Study(tiny, data, results).points("system1", ["novice_only"], [0.25])
    row = run_here(trial, data, results, progress=False)
    assert (
        ProvenanceTimer("driving", trial, data).done().digests == row.provenance.digests
    )
    assert Results(results).frame().repeated.tolist() == [True]
    other = [place + 1.0 for place in first.likeness.places[0]]
    likeness = dataclasses.replace(first.likeness, places=(other,) * 9)
    strange = dataclasses.replace(first, digest="elsewhere", likeness=likeness)
    known_motion.note([strange], results)
    with pytest.raises(known_motion.OtherMotion, match="name another folder"):
        run_here(trial.replace(seed=1), data, results, progress=False)
