"""Several experts: the family, its motion, and novices learnt with its SIDM."""

import dataclasses
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from companion import Study
from companion.digests import find_digest
from companion.engine.datasets import load_dataset
from companion.engine.frame import frame_of, records_frame
from companion.studies.several_experts import measure as x
from companion.studies.several_experts.family import collect_members, dataset
from companion.studies.several_experts.results import (
    MEMBER,
    PAPER_EXPERT,
    before_training,
    by_size,
    claims,
    costs,
    figure,
    table,
)
from sidm import systems
from sidm.drives import STEPS
from sidm.systems import LINEAR, LOGARITHMIC, ROLES, SYSTEMS, family_robot
from tests.companion.conftest import kept, made, write_motion


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
    with ThreadPoolExecutor(1) as executor:
        collect_members(
            "system1", "held", {0: [1]}, tmp_path, tmp_path / "results", executor
        )
    one = dataset("system1", 0, "held", 1)
    (found,) = load_dataset(
        one, find_digest(one, tmp_path / "nothing", tmp_path / "results"), tmp_path
    )
    assert found.states.shape == (STEPS + 1, 13)
    assert np.isfinite(found.states).all()
    assert len(found.discarded) == 4
    # everything is done
    collect_members("system1", "held", {0: [4]}, tmp_path, tmp_path, None)


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
    assert x.members_needed(jobs) == {0: {whole // 2, whole}}
    assert "unknown" not in jobs[1].members_data
    assert all(job.fresh.frozen == "sidm" for job in jobs)


def test_another_robot_has_a_folder_of_its_own(monkeypatch):
    before = dataset("system1", 0, "held", 1)
    monkeypatch.setattr(systems, "FAMILY_SEED", 6)
    assert dataset("system1", 0, "held", 1).collection != before.collection
    assert (
        dataset("system2", 0, "held", 1).collection.role
        != dataset("system1", 0, "held", 1).collection.role
    )


@pytest.mark.parametrize("number", [0, 1, 2])
def test_novices_are_learnt_every_way_and_stored(jobs, data, tmp_path, golden, number):
    job = jobs[number]
    result = x.measure(job, data)
    assert (
        np.array(result.validation_loss).shape
        == np.array(result.samples).shape
        == (3, 2)
    )
    assert np.array(result.component_losses).sum(-1) == pytest.approx(
        np.array(result.validation_loss)
    )
    assert (np.array(result.best_samples) <= np.array(result.samples)).all()
    assert (
        set(result.nearest) <= {"expert"}
        if job.experts == job.paper
        else {"expert", "member0"}
    )
    assert np.array(result.before).shape == (2, job.experts)
    assert len(result.experts_loss) == job.experts
    assert len(result.experts_curve_samples) > 0
    figures = {
        name: getattr(result, name)
        for name in ("validation_loss", "before", "experts_loss", "samples")
    }
    golden.hold(
        f"{job.experts} experts" + ", the paper's" * job.paper,
        "experts",
        figures,
        rel=0.05,
    )
    assert kept(x.records(tmp_path), result)


def test_the_sidm_of_the_experts_is_trained_once(jobs, data, monkeypatch):
    """The second call reads the stored weights and gives the same."""
    first = x.measure(jobs[0], data)
    monkeypatch.setattr(x, "train_several", None)
    repeated = x.measure(jobs[0], data)
    assert repeated.before == first.before
    assert repeated.validation_loss == first.validation_loss
    assert repeated.experts_curve_test_loss == first.experts_curve_test_loss


def test_the_single_experts_novice_has_more_data_besides(tmp_path):
    """All trainings are tested more often than elsewhere."""
    jobs = x.jobs(Study("laptop", tmp_path, tmp_path), "system1")
    assert {(job.experts, job.paper, job.sizes) for job in jobs} == {
        (1, True, (1.0, 5.0, 20.0, 60.0)),
        (1, False, (1.0, 5.0, 20.0)),
        *((count, True, (1.0, 5.0, 20.0)) for count in (2, 4, 8)),
    }
    assert {
        one.test_interval for job in jobs for one in (job.fresh, job.trial.training)
    } == {5}


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


def test_figure_3_stands_beside(made_up, joint):
    rows = costs(joint)
    assert set(rows.method) == {"sidm", "novice_only"} and not len(costs(joint[:0]))
    assert rows[["seeds", "loss", "samples", "minutes"]].to_numpy() == pytest.approx(
        np.tile([3, 2, 300, 0.2], (6, 1))
    )
    labels = [
        line.get_label() for line in figure(table(made_up), joint).axes[0].get_lines()
    ]
    assert labels[-2:] == ["without SIDM", "with SIDM, all at once"]


def test_the_nearest_experts_loss_is_that_of_its_place(made_up):
    """Experts are named in the order of the losses before training.

    The paper's expert is first, if it is among them, then the members.
    """
    two = made_up[(made_up.experts == 2) & (made_up.trial_seed == 0)]
    before, role = ((9.0, 1.0), (9.0, 2.0), (9.0, 3.0)), "member0"
    rows = before_training(two.assign(nearest=[(role,) * 3], before=[before]))
    assert rows.loss.tolist() == [1, 2, 3] and set(rows.nearest) == {role}
    assert rows.novice_minutes.tolist() == [1, 5, 20]
    assert set(rows.experts) == {"2 experts"}


def test_the_figure_has_a_plot_for_each_way(made_up, joint):
    axes = figure(table(made_up), joint[:0]).axes
    looks = [(line.get_color(), line.get_linestyle()) for line in axes[0].get_lines()][
        :3
    ]
    few = figure(table(made_up[made_up.experts == 2]), joint[:0]).axes[0].get_lines()
    assert len(set(looks)) == 3
    assert (few[0].get_color(), few[0].get_linestyle()) == looks[2]
    assert [one.get_title(loc="left").replace("\n", " ") for one in axes] == list(
        x.WAYS.values()
    )
    labels = [line.get_label() for line in axes[0].get_lines()]
    assert labels[:3] == ["the paper's expert", "1 of the family", "2 experts"]
    nothing = table(made_up[:0])
    assert figure(nothing, joint).axes[0].texts[0].get_text() == "no trials stored"
    assert not len(by_size(nothing))
