"""The distance between two robots' responses, on made-up motion, and the saving."""

import numpy as np
import pandas as pd
import pytest

from companion.studies import payoff
from companion.studies.payoff import Group, PlanarMotion
from sidm.storage import write_record
from tests.companion.conftest import RESULTS


def drive(
    seed: int,
    speed: float = 1.0,
    turning: float = 1.0,
    pieces: int = 60,
    steps: int = 40,
) -> PlanarMotion:
    """Drive of a robot whose speed and yaw rate follow its commands, by two factors."""
    rng = np.random.default_rng(seed)
    actions = np.repeat(rng.uniform(-1, 1, (pieces, steps // 10, 2)), 10, axis=1)
    yaw = np.cumsum(np.pad(0.1 * turning * actions[..., 1], ((0, 0), (1, 0))), axis=1)
    way = 0.1 * speed * actions[..., 0]
    steps_xy = np.stack([way * np.cos(yaw[:, :-1]), way * np.sin(yaw[:, :-1])], -1)
    place = np.cumsum(np.pad(steps_xy, ((0, 0), (1, 0), (0, 0))), axis=1)
    rate = np.pad(turning * actions[..., 1], ((0, 0), (0, 1)), mode="edge")
    return PlanarMotion(np.concatenate([place, yaw[..., None]], -1), rate, actions)


def test_a_command_is_told_by_what_it_leads_to():
    """A robot that is twice as fast has half the command for the same twist.

    So the features of both robots are alike.
    """
    slow, fast = (payoff.motion_samples(drive(0, speed)) for speed in (1.0, 2.0))
    assert np.allclose(2 * slow.features[:, 3], fast.features[:, 3], atol=0.02)
    assert slow.features.shape == (60 * 27, 5) and slow.motions.shape == (60 * 27, 3)


def test_a_robot_of_the_same_kind_predicts_as_well_as_the_novice_itself():
    measured = payoff.gap(drive(1), drive(2))
    assert measured["displacement"] == pytest.approx(
        measured["own_displacement"], rel=0.3
    )


def test_a_robot_that_slips_predicts_worse(rng):
    """The robot's path bends to the left.

    Neither velocity nor command shows this.
    """
    novice = drive(2)
    bent = np.linspace(0, 1, novice.poses.shape[1]) ** 2
    other = drive(1)
    poses = other.poses.copy()
    poses[..., 1] += bent
    measured = payoff.gap(other._replace(poses=poses), novice)
    assert measured["displacement"] > 1.5 * measured["own_displacement"]


def results(system: str, **losses) -> pd.DataFrame:
    """Three seeds of methods' losses, by minutes of data."""
    lines = [
        (system, method, minutes, seed, loss + seed / 1e4)
        for method, some in losses.items()
        for minutes, loss in some.items()
        for seed in range(3)
    ]
    return pd.DataFrame(
        lines, columns=["system", "method", "novice_minutes", "seed", "validation_loss"]
    )


def test_savings_stand_beside_the_gap(tmp_path):
    """Made up: fine-tuning with one minute is as good as training alone with four."""
    write_record(
        tmp_path / payoff.NAME,
        {
            "found": {
                "system1": {
                    "displacement": 0.4,
                    "heading": 0.9,
                    "own_displacement": 0.1,
                    "own_heading": 0.1,
                }
            }
        },
    )
    gaps = payoff.gaps(tmp_path)
    assert gaps.gap.tolist() == pytest.approx([6.0])
    frame = results(
        "system1",
        novice_only={1.0: 4.0, 4.0: 2.0, 16.0: 1.0},
        pretrain_finetune={1.0: 2.0, 4.0: 1.0},
    )
    bodies = results(
        "no map", novice_only={1.0: 4.0, 4.0: 2.0}, sidm={1.0: 4.0, 4.0: 2.0}
    )
    saved = payoff.saved(
        {"alike": Group(frame, 1.0), "unlike": Group(bodies, 1.0, pair="system1")}
    )
    rows = payoff.table(gaps, saved).set_index(["kind", "method"])
    assert rows.ratio["alike", "pretrain_finetune"] == pytest.approx(4, rel=0.01)
    assert rows.ratio["unlike", "sidm"] == pytest.approx(1, rel=0.01)
    assert (rows.gap == gaps.gap[0]).all()
    assert len(payoff.figure(rows.reset_index()).axes) == 2


def test_without_results_there_is_nothing_to_show(tmp_path):
    empty = results("system1", novice_only={1.0: 4.0})[:0]
    rows = payoff.table(
        payoff.gaps(tmp_path), payoff.saved({"none": Group(empty, 1.0)})
    )
    assert not len(rows) and payoff.figure(rows).axes


def test_one_expert_of_the_family_stands_beside_training_alone():
    frame = results("system1", novice_only={1.0: 4.0}, sidm={1.0: 3.0})
    ways = pd.DataFrame(
        {
            "system": "system1",
            "experts": [payoff.MEMBER_ALONE, "2 experts"],
            "way": "all",
            "seed": 0,
            "novice_minutes": 1.0,
            "loss": [2.0, 1.0],
        }
    )
    families = payoff.family_of(frame, ways)
    assert set(families.system) == {"family"}
    assert sorted(families.method.unique()) == ["novice_only", "pretrain_finetune"]
    assert families[
        families.method == "pretrain_finetune"
    ].validation_loss.tolist() == [2.0]


def test_every_kind_of_pair_is_stored():
    assert set(payoff.gaps(RESULTS).pair) >= {
        "system1",
        "system2_free_struts",
        "family",
        "husky to warthog",
    }
