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
from companion.engine.library import Library
from companion.engine.records import ProvenanceTimer, one_line, rounded
from companion.engine.run import checkpoint_folder
from companion.trials import motion_of
from sidm.config import ConfigError, replace
from sidm.shards import SHARD_SIZE


@pytest.fixture
def trials(study):
    """SIDM and its comparison, at the smaller size."""
    return study.figure3("system1")[:2]


@pytest.mark.parametrize("method", ["sidm", "novice_only"])
def test_a_trial_end_to_end(study, data, method):
    """A trial trains, validates and rolls out; parts of the outcome agree.

    It is a pure function to the last bit, on one thread whatever the caller uses.
    """
    trial, threads = study.trial("system1", method, 0.75), torch.get_num_threads()
    torch.manual_seed(1)
    row = run_trial(trial, data)
    out = row.outcome
    torch.manual_seed(2)
    assert perform(trial, data)[0] == out and torch.get_num_threads() == threads
    assert out.validation_loss == pytest.approx(sum(out.component_losses)) and (
        out.validation_loss > 0 and len(out.component_losses) == 13
    )
    assert len(out.position_error) == len(out.heading_error) == 25
    # whole batches
    assert out.iterations > 0 and 0 < out.samples < trial.training.max_samples + 8 * 64
    curve = out.curve_samples, out.curve_test_loss, out.curve_training_loss
    assert len({*map(len, curve)}) == 1 and len(curve[0]) <= 40
    assert list(curve[0]) == sorted(set(curve[0])) and curve[0][-1] <= out.samples
    assert min(out.curve_test_loss) <= out.best_test_loss  # smoothed
    # of a method without an adversary nothing is stored
    tests = len(out.every_test_loss) if method == "sidm" else 0
    assert len(out.every_test_loss) > 1
    for values in (out.every_discriminator_accuracy, out.every_matching_loss):
        assert len(values) == tests and (method == "novice_only" or values[-1] > 0)
    # all rollouts that exist
    for states in (out.rollouts_predicted, out.rollouts_actual):
        assert np.shape(states) == (2, 26, 13)
    predicted, actual = out.rollouts_predicted[0], out.rollouts_actual[0]
    assert predicted[0] == pytest.approx(actual[0])
    made = row.provenance
    assert (made.threads, made.resumed, made.stale) == (1, False, False)


def test_another_bodys_losses_are_in_the_same_unit_for_every_seed(study, data):
    """Losses are divided by the variance of the validation data.

    The variance of the few trajectories that the model learnt from differs by seed.
    """
    network = replace(study.preset.network, novice_body=NOVICES["planar"])
    other_study = Study(replace(study.preset, network=network))
    for seed in (0, 1):
        trial = other_study.trial("system1", "novice_only", 0.75, seed)
        outcome, trained = perform(trial, data)
        motion = Library(data).motion(trial, "validation")
        with torch.inference_mode():
            predicted, _ = trained.model("novice", motion.inputs, motion.maps)
        off = predicted - motion.targets
        spread = motion.targets.flatten(0, 1).std(0, correction=0)
        # components that stand still in the made-up motion have almost no variance
        moves = spread > 1e-3
        expected = (off.square().mean((0, 1)) / spread.square())[moves]
        assert moves.sum() >= 4
        losses = np.array(outcome.component_losses)[moves]
        assert losses == pytest.approx(expected.numpy(), rel=1e-3)


def test_run_skips_what_is_stored(trials, data, tmp_path, make_row):
    """Stored rows are left alone and others are run; a second run changes nothing."""
    store = Results(tmp_path)
    store.put(make_row(trials[0], loss=42.0))
    options = dict(data=data, results=store, progress=False)
    with ThreadPoolExecutor(1) as executor:
        assert run(trials * 2, executor, **options) is store
        assert store.missing(trials) == []
        assert store.get(trials[0]).outcome.validation_loss == 42.0
        files = {path: path.stat().st_mtime_ns for path in tmp_path.iterdir()}
        run(trials, executor, **options)
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
    stores = [
        run(trials, workers=workers, data=data, results=tmp_path / f"{workers}")
        for workers in (1, 2)
    ]
    one, two = ([row.outcome for row in store.stored(trials)] for store in stores)
    assert one == two and len(one) == 2
    here = perform(trials[0], data)[0]
    assert rounded(here.position_error) == list(one[0].position_error)
    assert rounded(here.validation_loss) == one[0].validation_loss


def test_a_killed_trial_goes_on(trials, data, tmp_path):
    """A trial stopped in training resumes from its checkpoint to the same outcome."""
    trial, folder = trials[0], tmp_path / "checkpoint"

    class Killed(Exception):
        pass

    def kill(*_):
        if any(folder.rglob("*")):
            raise Killed

    with pytest.raises(Killed):
        run_trial(trial, data, folder, progress=kill)
    row = run_trial(trial, data, folder)
    assert row.provenance.resumed and row.outcome == perform(trial, data)[0]


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


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({}, r"the dataset system1/.* is not under .*; 'companion collect --preset"),
        ({"workers": 0}, "workers must be at least 1"),
        ({"bundle": -1}, "bundle must not be negative"),
    ],
)
def test_what_cannot_be_run_is_refused(tiny, tmp_path, changes, words):
    trials = [] if changes else Study(tiny).figure3("system1")
    with pytest.raises(ConfigError, match=words):
        run(trials, data=tmp_path, results=tmp_path, **changes)


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
    (trial,) = Study(tiny).points("system1", ["novice_only"], [0.25])
    row = run([trial], data=data, results=results, progress=False).get(trial)
    timed = ProvenanceTimer("driving", trial, data).done()
    assert timed.digests == row.provenance.digests
    assert Results(results).frame().repeated.tolist() == [True]
    other = [place + 1.0 for place in first.likeness.places[0]]
    likeness = dataclasses.replace(first.likeness, places=(other,) * 9)
    strange = dataclasses.replace(first, digest="elsewhere", likeness=likeness)
    known_motion.note([strange], results)
    with pytest.raises(known_motion.OtherMotion, match="name another folder"):
        run([trial.replace(seed=1)], data=data, results=results, progress=False)
