"""A target from elsewhere, on sliding bodies."""

import dataclasses
import functools

import numpy as np
import pytest

from sidm.__main__ import main
from sidm.config import ConfigError
from sidm.experiments import METHODS, StoreError, Study
from sidm.experiments.engine.provenance import here
from sidm.experiments.engine.records import key_of
from sidm.experiments.studies.catalogue import STUDIES
from sidm.experiments.studies.recorded_targets import transfer as e
from sidm.experiments.studies.recorded_targets.recorded import checksum_of, load_recorded, subsets
from sidm.experiments.studies.recorded_targets.results import (
    SHOWN,
    WITHOUT,
    best_alone,
    compare,
    elsewhere_figure,
    gather,
    grounds_agree,
    hoped,
    in_short,
    label,
    lines,
)
from sidm.recordings import Ground, Recording, RecordingError, read_recordings, write_recordings
from sidm.systems import find_system
from sidm.terrain import generate_terrain
from sidm.trajectory import STEPS
from tests.experiments.conftest import glide, write_motion


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
def data(tiny, tmp_path_factory):
    """The simulated robots' motion on disk."""
    folder = tmp_path_factory.mktemp("data")
    for dataset in e.proxies(tiny, "system1").values():
        write_motion(folder, dataset)
    return folder


@pytest.fixture(scope="module")
def jobs(tiny, data, recordings, tmp_path_factory):
    study = Study(tiny, data, tmp_path_factory.mktemp("results"))
    return [dataclasses.replace(job, held_out=2) for job in e.transfers(study, "system1", recordings, [0.25])]


def test_every_method_and_proxy_has_its_training(jobs):
    """The simulated novice is a similar expert; nobody else's p_e changes."""
    assert [(job.method, job.proxy) for job in jobs] == list(e.METHODS_HERE)
    assert {job.training.p_expert for job in jobs if job.method == "sidm"} == {0.75}
    assert {job.training.test_interval for job in jobs if job.fit == "gradients"} == {5}
    assert all((job.pretraining is not None) == METHODS[job.method].pretrained for job in jobs)
    assert {job.method for job in jobs if job.fit == "least_squares"} == {
        "least_squares", "least_squares_mirrored", "corrected", "corrected_averaged",
    }  # fmt: skip
    assert len({key_of(job) for job in jobs}) == len(jobs)


def test_simulated_robots_are_driven_as_the_recorded_ones_were(jobs):
    """Undone, the law of `bounded_noise` leaves shocks of the standard deviation that it prescribes."""
    assert {one.collection.policy for job in jobs for one in job.datasets.values()} == {"bounded_noise"}
    actions = np.stack([one.actions for one in read_recordings("recordings/system1.npz")])
    seen = np.arctanh(np.clip(actions, -1 + 1e-9, 1 - 1e-9))
    walk = (seen[:, 1:] - 0.8 * seen[:, :-1]) / 0.2
    shocks = walk[:, 1:] - 0.9 * walk[:, :-1]
    assert shocks.std() == pytest.approx(0.5, rel=0.02)


@pytest.mark.parametrize("number", range(len(e.METHODS_HERE)))
def test_a_transfer_is_trained_judged_and_stored(jobs, data, recordings, tmp_path, golden, number):
    """Also as it is before any recorded data, where a pretraining makes that possible; kept bit for bit."""
    job, store = jobs[number], e.stored(tmp_path)
    found = e.transfer(job, data, recordings)
    assert found.minutes == ((0.0, 0.25) if job.pretraining else (0.25,))
    for losses, whole in zip(found.component_losses, found.validation_loss, strict=True):
        assert sum(losses) == pytest.approx(whole) and len(losses) == 13
    assert {len(error) for error in found.position_error + found.heading_error} == {25} and not found.provenance.stale
    for pieces, whole in zip(found.piece_losses, found.validation_loss, strict=True):
        assert len(pieces) == 4 and np.mean(pieces) == pytest.approx(whole)
    assert len(found.curve_samples) == len(found.seconds) == len(found.best_test_loss) == 1
    assert 0 < found.best_samples[0] <= found.samples[0] and found.seconds[0] > 0
    figures = {name: getattr(found, name) for name in ("validation_loss", "samples", "best_test_loss")}
    golden.hold(f"recorded, {job.method}, {job.proxy}", "elsewhere", figures, rel=0.05)
    assert store.get(job) is None
    store.put(found)
    again = store.get(job)
    assert again.about == job and again.validation_loss == pytest.approx(found.validation_loss, rel=1e-5)


def test_a_sample_confirms_what_older_code_found(jobs, data, recordings, tmp_path, monkeypatch, capsys):
    """Of each kind, equal but for its seed, one is made again; its times may differ, its findings may not."""
    quick = [job for job in jobs if job.method in ("least_squares", "least_squares_mirrored")]
    store, work = e.stored(tmp_path), functools.partial(e.transfer, data=data, recordings=recordings)
    twice = [dataclasses.replace(job, seed=seed) for job in quick for seed in (0, 1)]
    for job in twice:
        found = work(job)
        wrong = 0.5 if job.method == "least_squares" else 0.0
        made = dataclasses.replace(found.provenance, numerics=found.provenance.numerics | {"elsewhere": 0})
        loss = tuple(one + wrong for one in found.validation_loss)
        store.put(dataclasses.replace(found, provenance=made, validation_loss=loss, seconds=(9.0,)))
    changes = dict(jobs=lambda *_: twice, work=work, stored=lambda _: store, collect=lambda *_: None)
    monkeypatch.setitem(STUDIES, "elsewhere", STUDIES["elsewhere"]._replace(**changes))
    words = ["confirm", "--study", "elsewhere", "--data", str(data), "--system", "system1", "--workers", "1"]
    assert main(words) == 1
    said = capsys.readouterr().out
    assert "2 records confirmed" in said and said.count("comes out otherwise") == 1
    assert any(f"{store.path(job)}: comes out" in said for job in twice if job.method == "least_squares")
    assert [store.get(job).provenance.stale for job in twice] == [job.method == "least_squares" for job in twice]
    assert {store.get(job).seconds for job in twice} == {(9.0,)}


def test_training_stopping_and_judging_have_grounds_of_their_own(recordings):
    """And of a seed fewer minutes are among more, in the same part."""
    found = load_recorded("system1", 2, 8, recordings)
    smaller, larger = (subsets(found, minutes, 0) for minutes in (0.25, 0.5))
    grounds = [set(found.pieces.ground[part].tolist()) for part in (*larger, found.judging)]
    assert not (grounds[0] & grounds[1] or grounds[0] & grounds[2] or grounds[1] & grounds[2])
    assert [len(part) for part in (*smaller, *larger)] == [1, 1, 4, 1]
    assert all(set(few.tolist()) <= set(many.tolist()) for few, many in zip(smaller, larger, strict=True))
    with pytest.raises(ConfigError, match=r"1 recorded minutes are 7 \+ 2 pieces, but 6 \+ 2 are there"):
        subsets(found, 1.0, 0)


@pytest.mark.parametrize("system", ["system1", "system2"])
def test_the_recordings_are_enough_for_every_seed(system):
    found = load_recorded(system, e.HELD_OUT, 8)
    for seed in range(3):
        train, test = subsets(found, max(e.SIZES), seed)
        assert (len(train), len(test)) == (35, 12)


def test_other_recordings_are_refused(recordings):
    with pytest.raises(RecordingError, match="has checksum .*, the training wants 0000"):
        load_recorded("system1", 2, 8, recordings, "0000")


def test_a_checksum_is_of_what_recordings_hold(recordings, tmp_path):
    """Not of their file: packed by another version they are the same, with another state or ground they are not."""
    found = read_recordings(recordings / "system1.npz")
    write_recordings(tmp_path / "again.npz", found, "packed again")
    again = read_recordings(tmp_path / "again.npz")
    assert (tmp_path / "again.npz").read_bytes() != (recordings / "system1.npz").read_bytes()
    assert len(checksum_of(found)) == 16 and checksum_of(again) == checksum_of(found)
    higher = found[0].ground._replace(heights=found[0].ground.heights + 0.001)
    other = found[0]._replace(states=found[0].states + 1e-5), found[0]._replace(ground=higher)
    assert len({checksum_of([one, *found[1:]]) for one in (found[0], *other)}) == 3


def test_a_damaged_record_is_named(jobs, tmp_path):
    store = e.stored(tmp_path)
    store.path(jobs[0]).parent.mkdir(parents=True)
    store.path(jobs[0]).write_text("{}")
    with pytest.raises(StoreError, match="damaged .*; delete it and run 'sidm study elsewhere'"):
        store.get(jobs[0])


@pytest.fixture
def made_up(jobs):
    """Records in which each method needs so many times less data than the recordings alone; loss 4 / data."""
    times = {
        "novice_only": 1, "least_squares": 1.25, "least_squares_mirrored": 0.8, "sidm": 2, "pretrain_finetune": 4,
        "corrected": 4, "corrected_averaged": 4,
    }  # fmt: skip
    found = []
    for seed in range(3):
        for job in jobs:
            minutes = ((0.0,) if job.pretraining else ()) + (1.0, 2.0, 5.0)
            power = times[job.method] * (2 if job.proxy == "novice" and job.method != "sidm" else 1)
            losses = tuple((4 + 0.1 * seed) / max(m * power, 0.5) for m in minutes)
            found.append(
                e.Transferred(
                    about=dataclasses.replace(job, seed=seed),
                    minutes=minutes,
                    validation_loss=losses,
                    component_losses=((0.0,) * 13,) * len(minutes),
                    piece_losses=tuple((loss,) * 4 for loss in losses),
                    position_error=tuple((loss / 10,) * 25 for loss in losses),
                    heading_error=((0.1,) * 25,) * len(minutes),
                    samples=(1,) * 3,
                    best_samples=(1,) * 3,
                    best_test_loss=(1.0,) * 3,
                    curve_samples=((1,),) * 3,
                    curve_test_loss=((1.0,),) * 3,
                    curve_training_loss=((1.0,),) * 3,
                    seconds=(1.0,) * 3,
                    pretraining_samples=1,
                    provenance=here(1.0, 1, False),
                )
            )
    return found


def test_a_line_is_held_against_the_best_alone(made_up):
    """Which are least squares here, made up to be worth 1.25 times the data of the network."""
    assert best_alone(made_up, "system1") == ("least_squares", "none") and best_alone(made_up, "system2") is None
    table = {(one.method, one.proxy, one.minutes): one for one in lines(made_up, "system1")}
    assert len(table) == 11 * 3 + 6 and all(one.seeds == 3 for one in table.values())
    half = table["sidm", "expert", 2.0]
    assert half.saving.ratio.value == pytest.approx(1.6) and half.saving.bound == "="
    assert half.ratio.value == pytest.approx(0.625) and half.ratio.high == pytest.approx(0.625)
    assert half.error == pytest.approx(half.loss / 10)
    assert table["pretrain_finetune", "novice", 5.0].saving.bound == ">="
    assert table["novice_only", "none", 1.0].ratio.value == pytest.approx(1.25)
    assert table["least_squares", "none", 1.0].saving is None
    nothing = table["pretrain_finetune", "expert", 0.0]
    assert nothing.saving is None and nothing.worth == "at most 1 min" and half.worth == ""


def test_the_hope_can_come_true_and_be_disappointed(made_up):
    """Half the loss surely; twice; and no verdict from two seeds or none."""
    expert, novice = hoped(made_up, "system1")
    assert expert.interval == pytest.approx((0.5, 0.5, 0.5)) and expert.verdict == "In the same direction"
    assert novice.ours == "0.5 [0.5, 0.5] times the loss"
    worse = [dataclasses.replace(one, validation_loss=tuple(4 * loss for loss in one.validation_loss))
             if one.about.method == "sidm" else one for one in made_up]  # fmt: skip
    assert [claim.verdict for claim in hoped(worse, "system1")] == ["Contrary"] * 2
    two = [one for one in made_up if one.about.seed < 2]
    assert [claim[2:4] for claim in hoped(two, "system1")] == [("0.5 times the loss (2 seeds)", "No verdict")] * 2
    assert [(claim.ours, claim.verdict) for claim in hoped(made_up, "system2")] == [("not run", "No verdict")] * 2


def test_methods_are_compared_over_all_sizes(made_up):
    first = compare(made_up, "system1", ("pretrain_finetune", "novice"), best_alone(made_up, "system1"))
    assert first.ratio.value == pytest.approx(1.25 / 8) and first.said == "better"
    assert compare(made_up, "system1", WITHOUT, WITHOUT).said == "no difference seen"
    assert compare(made_up, "system2", WITHOUT, WITHOUT).words == "not run"
    one = [one for one in made_up if one.about.seed == 0]
    assert compare(one, "system1", ("sidm", "expert"), WITHOUT).words == "0.5 times the loss (one seed)"


def test_the_network_without_sidm_can_be_what_is_compared_with(made_up):
    """Twice the data at each size; the larger two are beyond what was recorded."""
    table = [one for one in lines(made_up, "system1", WITHOUT) if (one.method, one.proxy) == ("sidm", "expert")]
    assert [one.saving.ratio.value for one in table] == pytest.approx([2, 2, 1])
    assert [one.saving.bound for one in table] == ["=", "=", ">="] and table[0].ratio.value == pytest.approx(0.5)


def test_grounds_are_counted_apart(made_up):
    """Four pieces on three grounds; on the last, of two pieces, the SIDM is made three times as bad."""
    grounds = np.array([4, 5, 7, 7])
    worse = [
        dataclasses.replace(one, piece_losses=tuple((*some[:2], 3 * some[2], 3 * some[3]) for some in one.piece_losses))
        if one.about.method == "sidm" else one for one in made_up
    ]  # fmt: skip
    assert grounds_agree(worse, "system1", ("sidm", "expert"), WITHOUT, grounds) == "2 of 3"
    assert grounds_agree(made_up, "system1", ("pretrain_finetune", "expert"), WITHOUT, grounds) == "3 of 3"
    assert grounds_agree(made_up, "system2", ("sidm", "expert"), WITHOUT, grounds) == "-"


def test_in_short_names_the_best(made_up):
    said = in_short(made_up, "system1")
    assert said.startswith("system1: with SIDM 0.5 [0.5, 0.5] times the loss") and "(simulated novice)" in said
    assert "times that of the best alone" in said and "Without any recorded data a model of the simulated" in said
    assert in_short(made_up, "system2") == "system2: not run"


def test_the_figure_draws_every_method_and_what_needs_no_data(made_up):
    left, right = elsewhere_figure(made_up).axes
    labels = [line.get_label() for line in left.get_lines()]
    assert [one for one in labels if "no recorded" not in one] == [label(*one) for one in SHOWN]
    assert len(labels) == len(SHOWN) + 2 and right.texts[0].get_text() == "no trials stored"
    own = gather(made_up, "system1", "sidm", "expert")
    assert np.allclose(left.get_lines()[1].get_ydata(), own.values.mean(0))
