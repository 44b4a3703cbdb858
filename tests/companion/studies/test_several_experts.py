"""Several experts: the family, its motion, and novices learnt with its SIDM."""

import dataclasses

import numpy as np
import pytest

from companion import Study
from companion.engine.datasets import collect_motion
from companion.engine.frame import frame_of, records_frame
from companion.studies.several_experts import measure as x
from companion.studies.several_experts.results import (
    MEMBER,
    PAPER_EXPERT,
    by_size,
    claims,
    table,
)
from companion.trials import Dataset
from sidm.config import to_mapping
from sidm.drives import STEPS
from sidm.shards import Collection, load
from sidm.systems import LINEAR, LOGARITHMIC, ROLES, SYSTEMS, family_robot
from tests.companion.conftest import made


def test_the_family_spans_the_papers_robots():
    robots = [dataclasses.asdict(family_robot(number)) for number in range(50)]
    pairs = SYSTEMS.values()
    paper = [dataclasses.asdict(pair.robot(role)) for pair in pairs for role in ROLES]
    for name, (low, high) in (LOGARITHMIC | LINEAR).items():
        values = {robot[name] for robot in robots}
        assert low <= min(values) < low + 0.3 * (high - low) and max(values) <= high
        assert len(values) > 40
        assert all(low <= robot[name] <= high for robot in paper)
    assert family_robot(3) == family_robot(3)


def test_a_members_motion_is_collected_once(tmp_path):
    """One shard of the first member of the family is collected."""
    wanted = {x.dataset("system1", 0, "held", 1): [0]}
    for progress in (False, True):  # the second time there is nothing to do
        collect_motion(wanted, tmp_path, 1, progress=progress, robots=x.robots)
    (one,) = wanted
    (found,) = load(tmp_path, one.collection, 1)
    assert found.states.shape == (STEPS + 1, 13) and np.isfinite(found.states).all()
    papers = Collection(system="system1", role="expert")
    assert x.robots(Dataset(collection=papers, count=1)) is None


@pytest.fixture
def jobs(tiny):
    return x.jobs(Study(tiny), "system1", [1, 2], [0.25, 0.75])


def test_all_experts_together_have_the_data_of_one(jobs, tiny):
    whole = tiny.datasets("system1")["expert"].count
    assert [
        (job.experts, job.paper, [member.count for member in job.members])
        for job in jobs
    ] == [(1, True, []), (2, True, [whole // 2]), (1, False, [whole])]
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
            trial, count = job.trial.replace(seed=seed), len(sizes)
            losses = tuple((4 + 0.1 * seed) / (size * job.experts) for size in sizes)
            result = made(
                x.PretrainingResult,
                dataclasses.replace(job, trial=trial, sizes=sizes),
                nearest=("expert",) * count,
                before=((9.0,) * job.experts,) * count,
                validation_loss=(losses,) * 3,
                samples=((2000,) * count,) * 3,
                seconds=((60.0,) * count,) * 3,
            )
            found.append(result)
    return records_frame(x.PretrainingResult, map(to_mapping, found))


def test_experts_are_compared_with_the_single_one(made_up):
    table_of_sizes = by_size(table(made_up))
    rows = table_of_sizes.set_index(["experts", "way", "novice_minutes"])
    assert len(rows) == 3 * 4 + 3 * 3 + 3 * 3
    two = rows.loc["2 experts", "parts", 5.0]
    assert (two.seeds, two.minutes, two.samples) == (3, 1, 2000)
    assert (two.saved, two.ratio) == pytest.approx((2, 0.5))
    assert np.isnan(rows.saved[PAPER_EXPERT, "parts", 5.0])
    assert rows.ratio[MEMBER, "all", 1.0] == pytest.approx(1)


def test_the_claims_are_of_most_experts_and_one(made_up, jobs, make_row):
    """Figure 3 has loss 2 without SIDM at the same sizes."""
    trial = jobs[0].trial.replace(pool_minutes=60.0)
    joint = frame_of(
        make_row(trial.replace(method=method, novice_minutes=minutes, seed=seed))
        for seed in range(3)
        for method in ("sidm", "novice_only")
        for minutes in (1.0, 5.0, 20.0)
    )
    rows = claims(table(made_up), joint)
    assert rows.verdict.tolist() == ["In the same direction"] * 6 + ["Contrary"] * 2
    assert rows.claim[1].startswith("loss after 2 experts / after 1 of the family")
    assert rows.ours[1] == "0.500 (0.500 to 0.500)"
    assert rows.ours[7] == "6.67 (6.67 to 6.67)"
    assert len(claims(table(made_up), joint[:0])) == 6
    assert not len(claims(table(made_up[:1]), joint))
