"""Recorded targets: their grounds and drives, and tables of made-up results."""

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
    page_table,
    table,
)
from ownrobot.fitting.windows import grounds_of
from ownrobot.recordings import RecordingError, read_drives, write_drives
from sidm.body import ROVER
from sidm.config import ConfigError, replace, to_mapping
from tests.companion.conftest import made, write_motion


@pytest.fixture(scope="module")
def jobs(tiny, recordings, tmp_path_factory):
    data = tmp_path_factory.mktemp("data")
    for dataset in e.proxies(tiny, "system1").values():
        write_motion(data, dataset)
    return e.jobs(Study(tiny), "system1", recordings, [0.25])


def test_simulated_robots_are_driven_as_the_recorded_ones_were(jobs):
    """Inverting the law of `bounded_noise` leaves shocks of its standard deviation."""
    datasets = (dataset for job in jobs for dataset in job.datasets.values())
    assert {dataset.collection.policy for dataset in datasets} == {"bounded_noise"}
    drives = read_drives("recordings/system1.npz", ROVER)
    actions = np.stack([drive.actions for drive in drives])
    seen = np.arctanh(np.clip(actions, -1 + 1e-9, 1 - 1e-9))
    walk = (seen[:, 1:] - 0.8 * seen[:, :-1]) / 0.2
    shocks = walk[:, 1:] - 0.9 * walk[:, :-1]
    assert shocks.std() == pytest.approx(0.5, rel=0.02)


def test_training_stopping_and_judging_have_grounds_of_their_own(recordings):
    """In a seed, fewer minutes are part of more minutes."""
    recorded = load_recorded("system1", 2, 8, recordings)
    smaller, larger = (subsets(recorded, minutes, 0) for minutes in (0.25, 0.5))
    assert [len(part) for part in (*smaller, *larger)] == [1, 1, 4, 1]
    for few, many in zip(smaller, larger, strict=True):
        assert set(few.tolist()) <= set(many.tolist())
    grounds, seen = grounds_of(recorded.drives), set()
    for part in (*larger, recorded.validation_numbers):
        own = set(grounds[part.numpy()].tolist())
        assert not own & seen
        seen |= own
    with pytest.raises(ConfigError, match=r"1 recorded minutes are 7 \+ 2 windows"):
        subsets(recorded, 1.0, 0)
    with pytest.raises(RecordingError, match="has checksum .*, the training wants 00"):
        load_recorded("system1", 2, 8, recordings, "0000")


def test_a_checksum_is_of_what_recordings_hold(recordings, tmp_path):
    """Another packing leaves it the same; another state or ground changes it."""
    first, *others = drives = read_drives(recordings / "system1.npz", ROVER)
    write_drives(tmp_path / "again.npz", drives, "packed again")
    repeated = read_drives(tmp_path / "again.npz", ROVER)
    assert checksum_of(repeated) == checksum_of(drives)
    higher = first.ground._replace(heights=first.ground.heights + 0.001)
    moved = replace(first, states=first.states + 1e-5)
    changed = first, moved, replace(first, ground=higher)
    assert len({checksum_of([one, *others]) for one in changed}) == 3


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
            power = times[job.method]
            if job.proxy == "novice" and job.method != "sidm":
                power *= 2
            losses = tuple((4 + 0.1 * seed) / max(m * power, 0.5) for m in minutes)
            result = made(
                e.TransferResult,
                dataclasses.replace(job, seed=seed),
                minutes=minutes,
                validation_loss=losses,
                piece_losses=tuple((loss,) * 4 for loss in losses),
                position_error=tuple((loss / 10,) * 25 for loss in losses),
            )
            found.append(result)
    return table(records_frame(e.TransferResult, map(to_mapping, found)))


def test_a_size_is_held_against_the_best_alone(made_up):
    """The best is least squares, whose data count 1.25 times the network's."""
    best = best_alone(made_up, "system1")
    assert best == ("least_squares", "none") and best_alone(made_up, "system2") is None
    rows = by_size(made_up, best).set_index(["method", "proxy", "novice_minutes"])
    assert len(rows) == 11 * 3 + 6 and set(rows.seeds) == {3}
    half = rows.loc["sidm", "expert", 2.0]
    expected = (1.6, 0.625, 0.625, half.loss / 10)
    assert (half.saved, half.ratio, half.high, half.error) == pytest.approx(expected)
    assert rows.bound["pretrain_finetune", "novice", 5.0] == ">="
    assert rows.ratio["novice_only", "none", 1.0] == pytest.approx(1.25)
    nothing = rows.loc["pretrain_finetune", "expert", 0.0]
    assert np.isnan(nothing.saved) and nothing.worth == "at most 1 min"
    assert np.isnan(rows.saved["least_squares", "none", 1.0])
    times = page_table(by_size(made_up, best))["times the data"]
    assert {"1.6 (1.6 to 1.6)", "at most 1 min", "-"} <= set(times)


@pytest.mark.parametrize(
    ("factor", "seeds", "ours", "verdict"),
    [
        (4, 3, "2.00 (2.00 to 2.00)", "Contrary"),
        (1, 2, "0.500", "No verdict"),
    ],
)
def test_the_hope_can_come_true_and_be_disappointed(
    made_up, factor, seeds, ours, verdict
):
    loss = made_up.loss.where(made_up.method != "sidm", factor * made_up.loss)
    rows = claims(made_up.assign(loss=loss)[made_up.seed < seeds])
    assert rows.ours.tolist() == [ours] * 2
    assert rows.verdict.tolist() == [verdict] * 2
