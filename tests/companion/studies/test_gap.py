"""The distance of two robots before learning: gap, overlap, and what it pays."""

import numpy as np
import pandas as pd
import pytest

from companion import Study
from companion.registry import MEASUREMENTS
from companion.studies import nearest_neighbours, simulated_gap, when_it_pays
from companion.studies.several_experts import results as family_results
from companion.studies.when_it_pays import PlanarMotion
from sidm.storage import write_record
from sidm.systems import FREE_SYSTEMS, PAPER_SYSTEMS
from tests.companion.conftest import RESULTS


def test_components_are_told_in_the_frame_of_the_start():
    """A turn goes on across 180 degrees."""
    yaw = 3.0
    states = np.zeros((3, 13))
    for number, turn in enumerate((0.0, 0.1, 0.3)):
        states[number, 5:7] = np.sin((yaw + turn) / 2), np.cos((yaw + turn) / 2)
    states[1:, :2] = np.array([np.cos(yaw), np.sin(yaw)])
    states[2, 2], states[:, 7] = 0.2, 0.5
    parts = simulated_gap.components(states, yaw)
    assert parts[1] == pytest.approx([1, 0, 0, 0, 0, 0.1, 0.5, *[0] * 5])
    assert parts[2, :6] == pytest.approx([1, 0, 0.2, 0, 0, 0.3])


@pytest.mark.more
def test_a_pair_is_measured_from_the_same_starts(tmp_path, monkeypatch):
    """The result does not depend on how many starts a worker drives."""
    monkeypatch.setattr(simulated_gap, "EVERY_SYSTEM", ("system1",))
    monkeypatch.setattr(simulated_gap, "STARTS", 3)
    MEASUREMENTS["gap"].run(Study("smoke"), None, 1, tmp_path, tmp_path)
    table = simulated_gap.table(tmp_path)
    forward = table[table.component == "forward"].set_index("time")
    assert forward.gap[2.5] > forward.gap[0.5] > 0
    one, both = (simulated_gap.simulate_components("system1", n) for n in ([1], [0, 1]))
    assert np.array_equal(one[:, 0], both[:, 1]) and not np.array_equal(one[0], one[1])


def test_stored_robots_drive_sensibly(tmp_path):
    """Robots with free struts move vertically less than rocks are high, in the mean."""
    table = simulated_gap.table(RESULTS)
    up = table[table.component == "up"]
    assert (up[["gap", "spread"]] < 0.2).all(axis=None)
    assert set(up.system) == {*PAPER_SYSTEMS, *FREE_SYSTEMS}
    assert simulated_gap.figure(simulated_gap.table(tmp_path)).axes[0].texts


@pytest.fixture
def drawn():
    """Function for inputs (N, 11) about a place and linear transitions (N, 13)."""
    rng = np.random.default_rng(0)
    law = rng.normal(size=(11, 13))

    def draw(count, place=0.0):
        inputs = place + rng.normal(size=(count, 11))
        return inputs, inputs @ law

    return draw


def test_like_robots_cover_each_other_and_one_that_was_elsewhere_nothing(drawn):
    expert, novice = nearest_neighbours.neighbourhoods(
        drawn(2000), drawn(2000), drawn(1000)
    ).values()
    found = expert.uncovered, expert.distance, expert.loss
    expected = (0.05, novice.distance, novice.loss)
    assert found == pytest.approx(expected, rel=0.1, abs=0.03)
    both = nearest_neighbours.neighbourhoods(
        drawn(500, place=9.0), drawn(500), drawn(300)
    )
    assert both["expert"].uncovered == 1
    assert both["expert"].distance > 4 * both["novice"].distance
    # each of the 13 components is off by 2, which adds 52
    inputs, targets = drawn(800)
    sides = (inputs, targets + 2), (inputs, targets), (inputs[:200], targets[:200])
    expert, novice = nearest_neighbours.neighbourhoods(*sides).values()
    assert expert.loss - novice.loss == pytest.approx(52, abs=8)


def test_an_overlap_that_is_measured_is_read(study, data, tmp_path, monkeypatch):
    monkeypatch.setattr(nearest_neighbours, "PAPER_SYSTEMS", ("system1",))
    assert nearest_neighbours.read(tmp_path) == {}
    MEASUREMENTS["overlap"].run(study, None, 1, data, tmp_path)
    monkeypatch.setattr(nearest_neighbours, "PAPER_SYSTEMS", ("system1", "added"))
    stored = nearest_neighbours.read(tmp_path)
    assert list(stored) == ["system1"] and {*stored["system1"]} == {"expert", "novice"}


def drive(seed: int, speed: float = 1.0, pieces: int = 60) -> PlanarMotion:
    """Drive of a robot whose speed and yaw rate follow its commands."""
    rng = np.random.default_rng(seed)
    actions = np.repeat(rng.uniform(-1, 1, (pieces, 4, 2)), 10, axis=1)
    yaw = np.cumsum(np.pad(0.1 * actions[..., 1], ((0, 0), (1, 0))), axis=1)
    way = 0.1 * speed * actions[..., 0]
    steps_xy = np.stack([way * np.cos(yaw[:, :-1]), way * np.sin(yaw[:, :-1])], -1)
    place = np.cumsum(np.pad(steps_xy, ((0, 0), (1, 0), (0, 0))), axis=1)
    rate = np.pad(actions[..., 1], ((0, 0), (0, 1)), mode="edge")
    return PlanarMotion(np.concatenate([place, yaw[..., None]], -1), rate, actions)


def test_a_command_is_told_by_what_it_leads_to():
    """A robot that is twice as fast has half the command for the same twist."""
    slow, fast = (when_it_pays.motion_samples(drive(0, speed)) for speed in (1.0, 2.0))
    assert np.allclose(2 * slow.features[:, 3], fast.features[:, 3], atol=0.02)


def test_a_like_robot_predicts_as_well_as_the_novice_and_one_that_slips_worse():
    """A path that bends to the left shows neither in velocity nor in command."""
    expert, novice = drive(1), drive(2)
    poses = expert.poses.copy()
    poses[..., 1] += np.linspace(0, 1, poses.shape[1]) ** 2
    like, bent = (
        when_it_pays.gap(e, novice) for e in (expert, expert._replace(poses=poses))
    )
    assert like["displacement"] == pytest.approx(like["own_displacement"], rel=0.3)
    assert bent["displacement"] > 1.5 * bent["own_displacement"]


def results(**losses) -> pd.DataFrame:
    """Three seeds of methods' losses, by minutes of data."""
    lines = [
        ("system1", method, minutes, seed, loss + seed / 1e4)
        for method, some in losses.items()
        for minutes, loss in some.items()
        for seed in range(3)
    ]
    columns = ["system", "method", "novice_minutes", "seed", "validation_loss"]
    return pd.DataFrame(lines, columns=columns)


def test_savings_stand_beside_the_gap(tmp_path):
    """Fine-tuning with one minute is as good as training alone with four."""
    nothing = when_it_pays.savings_of("none", results(novice_only={1.0: 4.0})[:0])
    assert not len(when_it_pays.table(when_it_pays.gaps(tmp_path), nothing))
    errors = {"displacement": 0.4, "heading": 0.9}
    own = {"own_displacement": 0.1, "own_heading": 0.1}
    found = {"system1": errors | own}
    write_record(tmp_path / when_it_pays.NAME, {"found": found})
    gaps = when_it_pays.gaps(tmp_path)
    assert gaps.gap.tolist() == pytest.approx([6.0])
    alone = {1.0: 4.0, 4.0: 2.0, 16.0: 1.0}
    frame = results(novice_only=alone, pretrain_finetune={1.0: 2.0, 4.0: 1.0})
    bodies = results(novice_only=alone, sidm=alone).assign(system="no map")
    saved = [
        when_it_pays.savings_of(when_it_pays.PAPER, frame),
        when_it_pays.savings_of(when_it_pays.BODIES, bodies, pair="system1"),
    ]
    table = when_it_pays.table(gaps, pd.concat(saved))
    rows = table.set_index(["kind", "method"])
    assert rows.ratio[when_it_pays.PAPER, "pretrain_finetune"] == pytest.approx(
        4, rel=0.01
    )
    assert rows.ratio[when_it_pays.BODIES, "sidm"] == pytest.approx(1, rel=0.01)
    assert (rows.gap == gaps.gap[0]).all()
    left, right = when_it_pays.figure(table).axes
    titles = [axes.get_title(loc="left") for axes in (left, right)]
    assert titles == ["an SIDM", "fine-tuning"]
    labels = [label.get_text() for label in left.get_yticklabels()]
    rows = ["system 1 (gap 6.0)", "no map (gap 6.0)"]
    assert labels[1::2] == rows and "4.0" in {t.get_text() for t in right.texts}


def test_one_expert_of_the_family_stands_beside_training_alone():
    frame = results(novice_only={1.0: 4.0}, sidm={1.0: 3.0})
    ways = {"system": "system1", "way": "all", "seed": 0, "novice_minutes": 1.0}
    experts = {"experts": [family_results.MEMBER, "2 experts"], "loss": [2.0, 1.0]}
    families = when_it_pays.family_of(frame, pd.DataFrame(experts | ways))
    assert set(families.system) == {"family"}
    tuned = families[families.method != "novice_only"]
    assert tuned.validation_loss.tolist() == [2.0]
    assert set(tuned.method) == {"pretrain_finetune"}
    kinds = {"system1", "system2_free_struts", "family", "husky to warthog"}
    assert set(when_it_pays.gaps(RESULTS).pair) >= kinds
