"""Recorded targets, on sliding bodies."""

import dataclasses

import numpy as np
import pytest

from companion import METHODS, Study
from companion.engine.frame import records_frame
from companion.engine.records import key_of
from companion.studies.recorded_targets import measure as e
from companion.studies.recorded_targets.recorded import (
    checksum_of,
    load_recorded,
    subsets,
)
from companion.studies.recorded_targets.results import (
    SHOWN,
    WITHOUT,
    best_alone,
    by_size,
    claims,
    compare,
    figure,
    grounds_agree,
    label,
    page_table,
    table,
)
from sidm.body import ROVER
from sidm.config import ConfigError, replace
from sidm.drives import STEPS, Drive, Ground
from sidm.fitting.windows import grounds_of
from sidm.recordings import RecordingError, read_drives, write_drives
from sidm.systems import find_system
from sidm.terrain import generate_terrain
from tests.companion.conftest import glide, kept, made, write_motion


@pytest.fixture(scope="module")
def recordings(tmp_path_factory):
    """A folder with twelve drives over six grounds for system 1."""
    folder, rng = tmp_path_factory.mktemp("recordings"), np.random.default_rng(1)
    drives = []
    for number in range(12):
        heights = generate_terrain(find_system("system1").terrain, number // 2)
        actions = np.tile(rng.uniform(-1, 1, 2), (STEPS, 1))
        drives.append(
            Drive(
                glide(heights, actions, rng).astype(float),
                actions,
                ROVER,
                Ground(heights, 0.1),
            )
        )
    write_drives(folder / "system1.npz", drives, "made up")
    return folder


@pytest.fixture(scope="module")
def data(tiny, tmp_path_factory):
    """Folder with the simulated robots' motion."""
    folder = tmp_path_factory.mktemp("data")
    for dataset in e.proxies(tiny, "system1").values():
        write_motion(folder, dataset)
    return folder


@pytest.fixture(scope="module")
def jobs(tiny, data, recordings, tmp_path_factory):
    study = Study(tiny, data, tmp_path_factory.mktemp("results"))
    return [
        dataclasses.replace(job, held_out=2)
        for job in e.jobs(study, "system1", recordings, [0.25])
    ]


def test_every_method_and_proxy_has_its_training(jobs):
    """The simulated novice is a similar expert; p_e changes for no other expert."""
    assert [(job.method, job.proxy) for job in jobs] == list(e.METHODS_AND_PROXIES)
    assert {job.training.p_expert for job in jobs if job.method == "sidm"} == {0.75}
    assert {job.training.test_interval for job in jobs if job.fit == "gradients"} == {5}
    assert all(
        (job.pretraining is not None) == METHODS[job.method].pretrained for job in jobs
    )
    assert {job.method for job in jobs if job.fit == "least_squares"} == {
        "least_squares",
        "least_squares_mirrored",
        "corrected",
        "corrected_averaged",
    }
    assert len({key_of(job) for job in jobs}) == len(jobs)


def test_simulated_robots_are_driven_as_the_recorded_ones_were(jobs):
    """Inverting the law of `bounded_noise` leaves shocks of its standard deviation."""
    assert {
        dataset.collection.policy for job in jobs for dataset in job.datasets.values()
    } == {"bounded_noise"}
    actions = np.stack(
        [drive.actions for drive in read_drives("recordings/system1.npz", ROVER)]
    )
    seen = np.arctanh(np.clip(actions, -1 + 1e-9, 1 - 1e-9))
    walk = (seen[:, 1:] - 0.8 * seen[:, :-1]) / 0.2
    shocks = walk[:, 1:] - 0.9 * walk[:, :-1]
    assert shocks.std() == pytest.approx(0.5, rel=0.02)


@pytest.mark.parametrize("number", range(len(e.METHODS_AND_PROXIES)))
def test_a_transfer_is_trained_judged_and_stored(
    jobs, data, recordings, tmp_path, golden, number
):
    """A pretrained model is also tested before any recorded data.

    Results are kept bit for bit.
    """
    job, store = jobs[number], e.records(tmp_path)
    result = e.measure(job, data, recordings)
    assert result.minutes == ((0.0, 0.25) if job.pretraining else (0.25,))
    for losses, whole in zip(
        result.component_losses, result.validation_loss, strict=True
    ):
        assert sum(losses) == pytest.approx(whole) and len(losses) == 13
    assert {len(error) for error in result.position_error + result.heading_error} == {
        25
    }
    for pieces, whole in zip(result.piece_losses, result.validation_loss, strict=True):
        assert len(pieces) == 4 and np.mean(pieces) == pytest.approx(whole)
    assert (
        len(result.curve_samples)
        == len(result.seconds)
        == len(result.best_test_loss)
        == 1
    )
    assert 0 < result.best_samples[0] <= result.samples[0] and result.seconds[0] > 0
    figures = {
        name: getattr(result, name)
        for name in ("validation_loss", "samples", "best_test_loss")
    }
    golden.hold(f"recorded, {job.method}, {job.proxy}", "elsewhere", figures, rel=0.05)
    assert store.get(job) is None
    assert kept(store, result)


def test_training_stopping_and_judging_have_grounds_of_their_own(recordings):
    """Training, stopping and testing use different grounds.

    In a seed, fewer minutes are part of more minutes.
    """
    recorded = load_recorded("system1", 2, 8, recordings)
    smaller, larger = (subsets(recorded, minutes, 0) for minutes in (0.25, 0.5))
    grounds = [
        set(grounds_of(recorded.drives)[part.numpy()].tolist())
        for part in (*larger, recorded.validation_numbers)
    ]
    assert not (
        grounds[0] & grounds[1] or grounds[0] & grounds[2] or grounds[1] & grounds[2]
    )
    assert [len(part) for part in (*smaller, *larger)] == [1, 1, 4, 1]
    assert all(
        set(few.tolist()) <= set(many.tolist())
        for few, many in zip(smaller, larger, strict=True)
    )
    with pytest.raises(
        ConfigError, match=r"1 recorded minutes are 7 \+ 2 windows, but 6 \+ 2"
    ):
        subsets(recorded, 1.0, 0)


@pytest.mark.parametrize("system", ["system1", "system2"])
def test_the_recordings_are_enough_for_every_seed(system):
    recorded = load_recorded(system, e.HELD_OUT, 8)
    for seed in range(3):
        train, test = subsets(recorded, max(e.SIZES), seed)
        assert (len(train), len(test)) == (35, 12)


def test_other_recordings_are_refused(recordings):
    with pytest.raises(
        RecordingError, match="has checksum .*, the training wants 0000"
    ):
        load_recorded("system1", 2, 8, recordings, "0000")


def test_a_checksum_is_of_what_recordings_hold(recordings, tmp_path):
    """The checksum is of the content, not of the file.

    Another version's packing leaves it the same; another state or ground changes it.
    """
    drives = read_drives(recordings / "system1.npz", ROVER)
    write_drives(tmp_path / "again.npz", drives, "packed again")
    repeated = read_drives(tmp_path / "again.npz", ROVER)
    assert (tmp_path / "again.npz").read_bytes() != (
        recordings / "system1.npz"
    ).read_bytes()
    assert len(checksum_of(drives)) == 16 and checksum_of(repeated) == checksum_of(
        drives
    )
    higher = drives[0].ground._replace(heights=drives[0].ground.heights + 0.001)
    other = (
        replace(drives[0], states=drives[0].states + 1e-5),
        replace(drives[0], ground=higher),
    )
    assert len({checksum_of([one, *drives[1:]]) for one in (drives[0], *other)}) == 3


@pytest.fixture
def made_up(jobs):
    """Records in which each method needs some times less data; the loss is 4 / data."""
    times = {
        "novice_only": 1,
        "least_squares": 1.25,
        "least_squares_mirrored": 0.8,
        "sidm": 2,
        "pretrain_finetune": 4,
        "corrected": 4,
        "corrected_averaged": 4,
    }
    found = []
    for seed in range(3):
        for job in jobs:
            minutes = ((0.0,) if job.pretraining else ()) + (1.0, 2.0, 5.0)
            power = times[job.method] * (
                2 if job.proxy == "novice" and job.method != "sidm" else 1
            )
            losses = tuple((4 + 0.1 * seed) / max(m * power, 0.5) for m in minutes)
            found.append(
                made(
                    e.TransferResult,
                    dataclasses.replace(job, seed=seed),
                    minutes=minutes,
                    validation_loss=losses,
                    piece_losses=tuple((loss,) * 4 for loss in losses),
                    position_error=tuple((loss / 10,) * 25 for loss in losses),
                )
            )
    return table(records_frame(e.TransferResult, found))


def test_a_size_is_held_against_the_best_alone(made_up):
    """The best is least squares, whose data count 1.25 times the network's."""
    best = best_alone(made_up, "system1")
    assert best == ("least_squares", "none") and best_alone(made_up, "system2") is None
    rows = by_size(made_up, best).set_index(["method", "proxy", "novice_minutes"])
    assert len(rows) == 11 * 3 + 6 and set(rows.seeds) == {3}
    half = rows.loc["sidm", "expert", 2.0]
    assert half.saved == pytest.approx(1.6) and half.bound == "=" and half.worth == ""
    assert (half.ratio, half.high, half.error) == pytest.approx(
        (0.625, 0.625, half.loss / 10)
    )
    assert rows.bound["pretrain_finetune", "novice", 5.0] == ">="
    assert rows.ratio["novice_only", "none", 1.0] == pytest.approx(1.25)
    nothing = rows.loc["pretrain_finetune", "expert", 0.0]
    assert np.isnan(nothing.saved) and nothing.worth == "at most 1 min"
    assert np.isnan(rows.saved["least_squares", "none", 1.0])
    page = page_table(by_size(made_up, best)).set_index(["method", "recorded (min)"])
    assert page["times the data"][label("sidm", "expert"), 2.0] == "1.6 (1.6 to 1.6)"
    assert (
        page["times the data"][label("pretrain_finetune", "expert"), 0.0]
        == "at most 1 min"
    )
    assert (
        page["ratio (95 % interval)"][label(*best), 1.0]
        == page["times the data"][label(*best), 1.0]
        == "-"
    )


def test_the_hope_can_come_true_and_be_disappointed(made_up):
    """The loss is surely halved; it is doubled; two seeds or none give no verdict."""
    rows = claims(made_up)
    assert rows.ours.tolist() == ["0.500 (0.500 to 0.500)"] * 2
    assert set(rows.verdict) == {"In the same direction"}
    worse = made_up.assign(
        loss=made_up.loss.where(made_up.method != "sidm", 4 * made_up.loss)
    )
    assert claims(worse).verdict.tolist() == ["Contrary"] * 2
    two = claims(made_up[made_up.seed < 2])
    assert two.verdict.tolist() == ["No verdict"] * 2
    assert two.ours.tolist() == ["0.500"] * 2
    assert not len(claims(made_up[:0]))


def test_methods_are_compared_over_all_sizes(made_up):
    rows = compare(made_up, best_alone(made_up, "system1")).set_index(
        ["method", "proxy"]
    )
    first = rows.loc["pretrain_finetune", "novice"]
    assert first.ratio == pytest.approx(1.25 / 8)
    assert first.verdict == "better"
    assert len(rows) == 10
    assert rows.verdict["novice_only", "none"] == "worse"
    one = compare(made_up[made_up.seed == 0], WITHOUT)
    assert set(one.verdict) == {"No verdict"} and set(one.seeds) == {1}


def test_grounds_are_counted_apart(made_up):
    """Four pieces lie on three grounds.

    On the last ground, of two pieces, the SIDM's loss is three times as high.
    """
    grounds = np.array([4, 5, 7, 7])
    pieces = [
        (*some[:2], 3 * some[2], 3 * some[3]) if method == "sidm" else some
        for some, method in zip(made_up.pieces, made_up.method, strict=True)
    ]
    assert grounds_agree(
        made_up.assign(pieces=pieces), ("sidm", "expert"), WITHOUT, grounds
    ) == (2, 3)
    assert grounds_agree(
        made_up, ("pretrain_finetune", "expert"), WITHOUT, grounds
    ) == (3, 3)
    assert grounds_agree(made_up[:0], ("sidm", "expert"), WITHOUT, grounds) is None


def test_the_figure_draws_every_method_and_what_needs_no_data(made_up):
    left, right = figure(made_up).axes
    labels = [line.get_label() for line in left.get_lines()]
    assert [one for one in labels if "no recorded" not in one] == [
        label(*one) for one in SHOWN
    ]
    assert len(labels) == len(SHOWN) + 2
    assert right.texts[0].get_text() == "no trials stored"
    own = (
        made_up[(made_up.method == "sidm") & (made_up.proxy == "expert")]
        .groupby("novice_minutes")
        .loss.mean()
    )
    assert np.allclose(left.get_lines()[1].get_ydata(), own)
