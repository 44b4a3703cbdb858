"""Collection: the rules of an episode, resuming, independence of workers and order."""

import json
import shutil
from concurrent.futures import Executor, Future
from pathlib import Path

import numpy as np
import pytest

from sidm.simulation import collect, discards
from sidm.simulation.collect import EpisodeRules, missing_shards
from sidm.systems import SYSTEMS
from sidm.terrain import generate_terrain
from sidm.trajectory import SHARD_SIZE, STEPS, Collection, ShardError, checksum, digest

COLLECTION = Collection(system="system1", role="novice", seed=77)


class InOrder(Executor):
    """Runs each shard at once, in this process, the last submitted first if asked."""

    def __init__(self):
        self.submitted = []

    def submit(self, call, *arguments):
        self.submitted.append(arguments)
        future = Future()
        future.set_result(call(*arguments))
        return future


@pytest.fixture(scope="module")
def collected(tmp_path_factory):
    """Two shards, made in this process."""
    root = tmp_path_factory.mktemp("data")
    return root, collect(root, COLLECTION, 2 * SHARD_SIZE, executor=InOrder(), progress=False)


def state(x=0.0, y=0.0, up=1.0, speed=0.0):
    values = np.zeros(13)
    values[:2], values[7] = (x, y), speed
    values[3], values[6] = (0.0, 1.0) if up > 0 else (1.0, 0.0)
    return values


def test_trajectories_have_their_length_order_and_terrain(collected):
    _, trajectories = collected
    assert [t.index for t in trajectories] == list(range(2 * SHARD_SIZE))
    for t in trajectories:
        assert t.states.shape == (STEPS + 1, 13) and t.states.dtype == np.float32 and t.actions.shape == (STEPS, 2)
        assert np.hypot(*t.states[0, :2]) < 0.2
    t = trajectories[3]
    assert checksum(generate_terrain(SYSTEMS["system1"].terrain, t.terrain_seed)) == t.terrain_checksum
    assert len({t.terrain_seed for t in trajectories}) == len(trajectories)
    assert set(discards(trajectories)) == {"stuck", "border", "rollover", "unstable"}


@pytest.fixture
def first_shard(collected, tmp_path):
    """A folder in which a collection was interrupted after its first shard."""
    path = COLLECTION.shard(tmp_path, 0)
    path.parent.mkdir(parents=True)
    return Path(shutil.copy(COLLECTION.shard(collected[0], 0), path))


def test_an_interrupted_collection_goes_on_and_ends_the_same(collected, first_shard, tmp_path):
    _, whole = collected
    assert missing_shards(tmp_path, COLLECTION, 2 * SHARD_SIZE) == [1]
    stray = COLLECTION.folder(tmp_path) / ".shard-00001.npz.1.part"  # what a killed worker leaves
    stray.write_bytes(b"half")
    rest = InOrder()
    again = collect(tmp_path, COLLECTION, 2 * SHARD_SIZE, executor=rest, progress=False)
    assert [arguments[2] for arguments in rest.submitted] == [1]
    assert digest(again) == digest(whole)


def test_other_processes_in_any_order_make_the_same(collected, tmp_path):
    _, whole = collected
    assert digest(collect(tmp_path, COLLECTION, SHARD_SIZE, workers=2, progress=False)) == digest(whole[:SHARD_SIZE])


def test_a_damaged_shard_is_named(first_shard, tmp_path):
    first_shard.write_bytes(first_shard.read_bytes()[:-3000])
    with pytest.raises(ShardError, match="shard-00000"):
        collect(tmp_path, COLLECTION, 2, executor=InOrder(), progress=False)


def test_stuck_after_more_than_25_steps_in_one_place():
    rules = EpisodeRules(state(), 14.95)
    assert [rules.ended(state(x=0.05)) for _ in range(25)] == [None] * 25
    assert rules.ended(state(x=0.05)) == "stuck"
    rules = EpisodeRules(state(), 14.95)
    assert not any(rules.ended(state(x=0.11 * k)) for k in range(100))


def test_border_rollover_and_instability_end_an_episode():
    assert EpisodeRules(state(), 14.95).ended(state(x=13.9)) is None
    assert EpisodeRules(state(), 14.95).ended(state(y=-14.0)) == "border"
    assert EpisodeRules(state(), 14.95).ended(state(up=-1)) == "rollover"
    assert EpisodeRules(state(), 14.95).ended(state(speed=15.1)) == "unstable"
    assert EpisodeRules(state(), 14.95).ended(state(x=np.nan)) == "unstable"


def test_a_collection_is_plain_data():
    assert json.loads(json.dumps(vars(COLLECTION))) == {
        "system": "system1", "role": "novice", "policy": "ornstein_uhlenbeck", "seed": 77,
    }  # fmt: skip
