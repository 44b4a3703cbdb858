"""Recorded targets, on sliding bodies."""

import dataclasses

import numpy as np
import pytest

from companion import Study
from companion.engine.frame import records_frame
from companion.studies.recorded_targets import measure as e
from companion.studies.recorded_targets.recorded import (
    checksum_of,
    load_recorded,
    subsets,
)
from companion.studies.recorded_targets.results import (
    best_alone,
    by_size,
    claims,
    label,
    page_table,
    table,
)
from ownrobot.fitting.windows import grounds_of
from ownrobot.recordings import RecordingError, read_drives, write_drives
from sidm.body import ROVER
from sidm.config import ConfigError, replace
from tests.companion.conftest import made, write_motion


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
