"""Several experts: the family, its motion, and novices learnt with its SIDM."""

import dataclasses

import numpy as np
import pytest

from companion import Study
from companion.engine.datasets import collect_motion
from companion.engine.frame import frame_of, records_frame
from companion.studies.several_experts import measure as x
from companion.studies.several_experts.family import dataset, robots
from companion.studies.several_experts.results import (
    MEMBER,
    PAPER_EXPERT,
    by_size,
    claims,
    table,
)
from companion.trials import Dataset
from sidm.drives import STEPS
from sidm.shards import Collection, load
from sidm.systems import LINEAR, LOGARITHMIC, ROLES, SYSTEMS, family_robot
from tests.companion.conftest import made, write_motion


def test_the_family_spans_the_papers_robots():
    """Every member lies within the ranges, which include the paper's four robots.

    No two members are alike.
    """
    robots = [dataclasses.asdict(family_robot(number)) for number in range(50)]
    paper = [
        dataclasses.asdict(system.robot(role))
        for system in SYSTEMS.values()
        for role in ROLES
    ]
    for name, (low, high) in (LOGARITHMIC | LINEAR).items():
        values = [robot[name] for robot in robots]
        assert low <= min(values) < low + 0.3 * (high - low)
        assert max(values) <= high
        assert len(set(values)) > 40
        assert all(low <= robot[name] <= high for robot in paper)
    assert family_robot(3) == family_robot(3)


def test_a_members_motion_is_collected_once(tmp_path):
    """One shard of the first member of the family is collected."""
    wanted = {dataset("system1", 0, "held", 1): [0]}
    for progress in (False, True):  # the second time there is nothing to do
        collect_motion(wanted, tmp_path, 1, progress=progress, robots=robots)
    (one,) = wanted
    (found,) = load(tmp_path, one.collection, 1)
    assert found.states.shape == (STEPS + 1, 13)
    assert np.isfinite(found.states).all()
    assert len(found.discarded) == 4
    assert (
        robots(Dataset(collection=Collection(system="system1", role="expert"), count=1))
        is None
    )


@pytest.fixture(scope="module")
def jobs(tiny, data, tmp_path_factory):
    study = Study(tiny, data, tmp_path_factory.mktemp("results"))
    for job in x.jobs(study, "system1", [1, 2], [0.25, 0.75]):
        for member in job.members:
            write_motion(data, member)
    return x.jobs(study, "system1", [1, 2], [0.25, 0.75])


def test_all_experts_together_have_the_data_of_one(jobs, tiny):
    whole = tiny.datasets("system1")["expert"].count
    expected = [(1, True), (2, True), (1, False)]
    assert [(job.experts, job.paper) for job in jobs] == expected
    assert [[member.count for member in job.members] for job in jobs] == [
        [],
        [whole // 2],
        [whole],
    ]
    needed = x.motion(jobs[2])
    (member,) = jobs[2].members
    assert len(needed[member]) == whole and len(needed) == 5
    assert all(job.fresh.frozen == "sidm" for job in jobs)


@pytest.fixture
def made_up(jobs):
    """Results in which two experts halve the data needed; the loss is 4 / data."""
    found = []
    for seed in range(3):
        for job in jobs:
            sizes = (1.0, 5.0, 20.0) if job.members else (1.0, 5.0, 20.0, 60.0)
            about = dataclasses.replace(
                job, trial=job.trial.replace(seed=seed), sizes=sizes
            )
            count = len(sizes)
            losses = tuple(
                (4 + 0.1 * seed) / (minutes * job.experts) for minutes in about.sizes
            )
            found.append(
                made(
                    x.PretrainingResult,
                    about,
                    nearest=("expert",) * count,
                    before=((9.0,) * job.experts,) * count,
                    validation_loss=(losses,) * 3,
                    samples=((2000,) * count,) * 3,
                    seconds=((60.0,) * count,) * 3,
                )
            )
    return records_frame(x.PretrainingResult, found)


def test_experts_are_compared_with_the_single_one(made_up):
    rows = by_size(table(made_up)).set_index(["experts", "way", "novice_minutes"])
    assert len(rows) == 3 * 4 + 3 * 3 + 3 * 3
    two = rows.loc["2 experts", "parts", 5.0]
    assert two.seeds == 3
    assert two.saved == pytest.approx(2)
    assert two.ratio == pytest.approx(0.5)
    assert two.minutes == 1
    assert two.samples == 2000
    assert np.isnan(rows.saved[PAPER_EXPERT, "parts", 5.0])
    assert rows.ratio[MEMBER, "all", 1.0] == pytest.approx(1)
    expected = [PAPER_EXPERT, MEMBER, "2 experts"]
    assert list(dict.fromkeys(rows.reset_index().experts)) == expected


@pytest.fixture
def joint(jobs, make_row):
    """Results of Figure 3 at the same sizes: 300 samples, and loss 2 without SIDM."""
    trial = jobs[0].trial.replace(pool_minutes=60.0)
    return frame_of(
        make_row(trial.replace(method=method, novice_minutes=minutes, seed=seed))
        for seed in range(3)
        for method in ("sidm", "novice_only")
        for minutes in (1.0, 5.0, 20.0)
    )


def test_the_claims_are_of_most_experts_and_one(made_up, joint):
    rows = claims(table(made_up), joint)
    assert len(rows) == 8 and not len(claims(table(made_up[:1]), joint))
    assert rows.verdict.tolist() == ["In the same direction"] * 6 + ["Contrary"] * 2
    assert (
        rows.claim[1] == "loss after 2 experts / after 1 of the family; "
        "all parts, from the nearest expert's"
    )
    assert (
        rows.ours[1] == "0.500 (0.500 to 0.500)"
        and rows.ours[7] == "6.67 (6.67 to 6.67)"
    )
    assert len(claims(table(made_up), joint[:0])) == 6
    alone = claims(table(made_up[made_up.paper]), joint)
    assert not alone.claim.str.contains("of the family").any()
