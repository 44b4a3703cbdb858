"""A target from elsewhere, on sliding bodies."""

import dataclasses

import numpy as np
import pytest

from sidm.experiments import METHODS, StoreError, Study
from sidm.experiments import elsewhere as e
from sidm.experiments.elsewhere_results import SHOWN, elsewhere_figure, gather, label, lines, needed
from sidm.experiments.provenance import here
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
    return [dataclasses.replace(job, held_out=2) for job in e.transfers(study, "system1", recordings, [0.25])]


def test_every_method_and_proxy_has_its_training(jobs):
    """The simulated novice is a similar expert; nobody else's p_e changes."""
    assert [(job.method, job.proxy) for job in jobs] == list(e.METHODS_HERE)
    assert {job.training.p_expert for job in jobs if job.method == "sidm"} == {0.75}
    assert all((job.pretraining is not None) == METHODS[job.method].pretrained for job in jobs)
    assert {job.method for job in jobs if job.fit == "least_squares"} == {
        "least_squares", "corrected", "corrected_averaged",
    }  # fmt: skip
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
    with pytest.raises(StoreError, match="damaged .*; delete it and run 'python -m sidm study elsewhere'"):
        store.get(jobs[0])


@pytest.fixture
def made_up(jobs):
    """Records in which each method needs so many times less data than the recordings alone; loss 4 / data."""
    times = dict(zip(e.METHODS_HERE, (1, 1, 2, 4, 4, 4, 1, 8, 8, 8), strict=True))
    found = []
    for seed in range(3):
        for job in jobs:
            minutes = ((0.0,) if job.pretraining else ()) + (1.0, 2.0, 5.0)
            losses = tuple((4 + 0.1 * seed) / max(m * times[job.method, job.proxy], 0.5) for m in minutes)
            found.append(
                e.Transferred(
                    about=dataclasses.replace(job, seed=seed),
                    minutes=minutes,
                    validation_loss=losses,
                    component_losses=((0.0,) * 13,) * len(minutes),
                    position_error=tuple((loss / 10,) * 25 for loss in losses),
                    samples=(1,) * len(minutes),
                    pretraining_samples=1,
                    source="",
                    provenance=here(1.0, 1, False),
                )
            )
    return found


def test_savings_are_those_that_were_made_up(made_up):
    table = {(one.method, one.proxy, one.minutes): one for one in lines(made_up, "system1")}
    assert len(table) == 10 * 3 + 6 and all(one.seeds == 3 for one in table.values())
    half = table["sidm", "expert", 2.0]
    assert half.saving.ratio.value == pytest.approx(2) and half.saving.bound == "="
    assert half.ratio.value == pytest.approx(0.5) and half.ratio.high == pytest.approx(0.5)
    assert table["pretrain_finetune", "novice", 5.0].saving.bound == ">="
    assert table["pretrain_finetune", "expert", 0.0].saving is None
    assert table["novice_only", "none", 1.0].saving is None
    assert table["sidm", "novice", 1.0].ratio.value == pytest.approx(1)
    assert half.error == pytest.approx(half.loss / 10)


def test_the_verdict_follows_from_the_savings(made_up):
    """Twice the data surely, four times, once, and a bound; nothing of what is not stored."""
    expert, first, solved, novice, both, _ = needed(made_up, "system1")
    assert expert.interval == pytest.approx((2, 2, 2)) and expert.verdict == "In the same direction"
    assert first.interval.value == solved.interval.value == pytest.approx(4)
    assert novice.interval.value == pytest.approx(1)
    assert both.ours.startswith("at least 5 x")
    assert [claim.ours for claim in needed(made_up, "system2")] == ["not run"] * 6


def test_the_figure_draws_every_method_and_what_needs_no_data(made_up):
    left, right = elsewhere_figure(made_up).axes
    labels = [line.get_label() for line in left.get_lines()]
    assert [one for one in labels if "no recorded" not in one] == [label(*one) for one in SHOWN]
    assert len(labels) == len(SHOWN) + 2 and right.texts[0].get_text() == "no trials stored"
    own = gather(made_up, "system1", "sidm", "expert")
    assert np.allclose(left.get_lines()[2].get_ydata(), own.values.mean(0))
