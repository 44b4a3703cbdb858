"""A target from elsewhere, on sliding bodies."""

import dataclasses

import numpy as np
import pytest

from sidm.experiments import StoreError, Study
from sidm.experiments import elsewhere as e
from sidm.experiments.records import key_of
from sidm.recordings import Ground, Recording, write_recordings
from sidm.systems import find_system
from sidm.terrain import generate_terrain
from sidm.trajectory import STEPS
from tests.experiments.conftest import glide


@pytest.fixture(scope="module")
def recordings(tmp_path_factory):
    """A folder with twelve drives over six grounds for system 1."""
    folder, rng = tmp_path_factory.mktemp("recordings"), np.random.default_rng(1)
    found = []
    for number in range(12):
        heights = generate_terrain(find_system("system1").terrain, number // 2)
        actions = np.tile(rng.uniform(-1, 1, 2), (STEPS, 1))
        found.append(Recording("a", glide(heights, actions, rng).astype(float), actions, Ground(heights, 0.1)))
    write_recordings(folder / "system1.npz", found, "made up")
    return folder


@pytest.fixture(scope="module")
def jobs(tiny, data, recordings, tmp_path_factory):
    study = Study(tiny, data, tmp_path_factory.mktemp("results"))
    return [dataclasses.replace(job, sizes=(0.25,), held_out=2) for job in e.transfers(study, "system1", recordings)]


def test_every_method_and_proxy_has_its_training(jobs):
    """The simulated novice is a similar expert; nobody else's p_e changes."""
    assert [(job.method, job.proxy) for job in jobs] == list(e.METHODS_HERE)
    assert {job.training.p_expert for job in jobs if job.method == "sidm"} == {0.75}
    assert all((job.pretraining is not None) == (job.method == "pretrain_finetune") for job in jobs)
    assert len({key_of(job) for job in jobs}) == len(jobs)


@pytest.mark.parametrize("number", range(len(e.METHODS_HERE)))
def test_a_transfer_is_trained_judged_and_stored(jobs, data, recordings, tmp_path, number):
    """Also as it is before any recorded data, where a pretraining makes that possible; kept bit for bit."""
    job, store = jobs[number], e.stored(tmp_path)
    found = e.transfer(job, data, recordings)
    assert found.minutes == ((0.0, 0.25) if job.pretraining else (0.25,))
    for losses, whole in zip(found.component_losses, found.validation_loss, strict=True):
        assert sum(losses) == pytest.approx(whole) and len(losses) == 13
    assert {len(error) for error in found.position_error} == {25} and not found.stale
    assert store.get(job) is None
    store.put(found)
    again = store.get(job)
    assert again.about == job and again.validation_loss == pytest.approx(found.validation_loss, rel=1e-5)


def test_recordings_that_judge_are_never_learnt_from(recordings):
    found = e.load_recorded("system1", 2, 8, recordings)
    assert not set(found.learning.tolist()) & set(found.judging.tolist()) and len(found.judging) == 4
    sets = e._sets(found, 0.25, 0, found.motion, found.motion)
    assert set(sets.train.indices.tolist()) | set(sets.test.indices.tolist()) <= set(found.learning.tolist())


def test_a_damaged_record_is_named(jobs, tmp_path):
    store = e.stored(tmp_path)
    store.path(jobs[0]).parent.mkdir(parents=True)
    store.path(jobs[0]).write_text("{}")
    with pytest.raises(StoreError, match="damaged .*; delete it and run 'python -m sidm.experiments.elsewhere'"):
        store.get(jobs[0])
