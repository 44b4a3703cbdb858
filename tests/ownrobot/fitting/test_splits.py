"""Splits keep sessions whole, and learn, stop and evaluate on different drives."""

import numpy as np
import pytest

from ownrobot.fitting.splits import (
    divided,
    folds,
    groups_of,
    session_order,
    split,
    train_test_split,
)
from sidm.config import ConfigError
from sidm.drives import Drive


def drive(session: str, steps: int = 10) -> Drive:
    return Drive(np.zeros((steps + 1, 13)), np.zeros((steps, 2)), session=session)


def sessions(drives):
    return "".join(sorted(drive.session for drive in drives))


@pytest.mark.parametrize(
    ("names", "share", "count"),
    [("aabbccdd", 0.25, 1), ("aabbccdd", 0.5, 2), ("aabb", 0.01, 1), ("aabb", 1.0, 1)],
)
def test_whole_sessions_are_held_out(names, share, count):
    learn, held_out = split([drive(name) for name in names], share, seed=3)
    assert not set(sessions(learn)) & set(sessions(held_out))
    assert len(set(sessions(held_out))) == count
    assert sessions(learn + held_out) == names


def test_of_a_single_session_drives_are_held_out():
    learn, held_out = split([drive("a") for _ in range(8)], 0.25, seed=0)
    assert (len(learn), len(held_out)) == (6, 2)
    with pytest.raises(ConfigError, match="a single drive leaves none to evaluate on"):
        split([drive("a")], 0.3, seed=0)


def test_each_session_is_held_out_in_one_fold():
    drives = [drive(name) for name in "aabbccddee"]
    parts = folds(drives, 3, seed=1)
    assert sorted("".join(sessions(p.held_out) for p in parts)) == list("aabbccddee")
    for learn, held_out in parts:
        assert not set(sessions(learn)) & set(sessions(held_out))
    assert len(folds(drives, 99, seed=0)) == 5


def test_the_test_that_stops_training_has_other_sessions():
    drives = [drive(name) for name in "aabbccddeeff"]
    train, test = train_test_split(drives, session_order(drives, 0))
    assert not set(sessions(train)) & set(sessions(test))
    assert len(set(sessions(test))) == 2  # every fourth, from the second


def test_a_few_drives_of_one_session_are_divided():
    """A single long drive is parted, and no step of it is lost or used twice."""
    long = Drive(
        np.zeros((131, 13)), np.stack([np.arange(130.0), np.zeros(130)], 1) / 130
    )
    parts = divided([long], 20)
    steps = np.concatenate([part.actions[:, 0] for part in parts])
    assert np.array_equal(steps, long.actions[:, 0])
    assert all(20 <= len(part) < 40 for part in parts)
    train, test = train_test_split(parts, session_order(parts, 0))
    assert len(train) + len(test) == len(parts) == 6 and len(test) == 2
    enough = [drive("a") for _ in range(4)]
    assert divided(enough, 5) == enough


def test_groups_are_sessions_or_the_drives_of_one():
    assert groups_of([drive("a"), drive("b"), drive("a")]).tolist() == ["a", "b", "a"]
    assert groups_of([drive("a"), drive("a")]).tolist() == ["0", "1"]
