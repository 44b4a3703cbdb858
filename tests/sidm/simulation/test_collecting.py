"""Collection: rules of an episode, resuming, independence of workers and order."""

import dataclasses
import json
import shutil
from concurrent.futures import Executor, Future
from pathlib import Path

import numpy as np
import pytest

from sidm.config import ConfigError
from sidm.drives import STEPS
from sidm.shards import SHARD_SIZE, Collection, ShardError, digest, missing_shards
from sidm.simulation import Simulator, collect, discards, simulate_trajectory
from sidm.simulation.collecting import EpisodeRules, draw_attempt
from sidm.storage import checksum
from sidm.systems import SYSTEMS, System, Terrain
from sidm.terrain import generate_terrain

COLLECTION = Collection(system="system1", role="novice", seed=77)


class InOrder(Executor):
    """Executor that runs each shard at once, in this process.

    If asked, it runs the last submitted shard first.
    """

    def __init__(self):
        self.submitted = []

    def submit(self, call, *arguments):
        self.submitted.append(arguments)
        future = Future()
        future.set_result(call(*arguments))
        return future


@pytest.fixture(scope="module")
def collected(tmp_path_factory):
    """Two shards that this process collected."""
    root = tmp_path_factory.mktemp("data")
    return root, collect(
        root, COLLECTION, 2 * SHARD_SIZE, executor=InOrder(), progress=False
    )


OWN = System(
    name="mine",
    novice=SYSTEMS["system1"].novice.replace(spring=20_000.0, throttle_scale=20.0),
    expert=SYSTEMS["system2"].expert,
    terrain=Terrain(cell_height_scale=0.1, size=120),
)


@pytest.mark.parametrize(
    "role", ["novice", pytest.param("expert", marks=pytest.mark.more)]
)
def test_robots_of_ones_own_drive_in_their_own_role(role, tmp_path):
    """`simulate` gives the drives of each robot on its own ground, in any process."""
    collection = Collection(system="mine", role=role, seed=3)
    drive = simulate_trajectory(collection, 0, OWN)
    number = sum(drive.discarded)
    seed, yaw, actions = draw_attempt(collection, 0, number)
    with Simulator(OWN.robot(role), generate_terrain(OWN.terrain, seed)) as simulator:
        states = [
            simulator.reset(0.0, 0.0, yaw),
            *(simulator.step(action) for action in actions),
        ]
    assert np.array_equal(drive.states, np.array(states, np.float32))
    other = simulate_trajectory(
        collection, 0, dataclasses.replace(OWN, novice=OWN.expert, expert=OWN.novice)
    )
    assert not np.array_equal(drive.states, other.states)
    # as a worker process would
    (first, *_) = collect(
        tmp_path, collection, 2, workers=1, progress=False, system=OWN
    )
    assert np.array_equal(first.states, drive.states)


def test_a_name_stands_for_one_pair(tmp_path):
    own = Collection(system="mine", role="novice", seed=3)
    with pytest.raises(ConfigError, match="unknown system 'mine'"):
        simulate_trajectory(own, 0)
    with pytest.raises(
        ConfigError,
        match="the collection is of 'system1', the robots given are of 'mine'",
    ):
        simulate_trajectory(COLLECTION, 0, OWN)
    with pytest.raises(
        ConfigError,
        match="'system1' is known with other robots, ground or physics; give yours",
    ):
        simulate_trajectory(COLLECTION, 0, dataclasses.replace(OWN, name="system1"))
    collect(tmp_path, own, 0, progress=False, system=OWN)
    collect(tmp_path, own, 0, progress=False, system=OWN)
    with pytest.raises(
        ConfigError,
        match="has motion of other robots called 'mine'; "
        "delete it or choose a new name",
    ):
        collect(
            tmp_path,
            own,
            0,
            progress=False,
            system=dataclasses.replace(OWN, expert=OWN.novice),
        )


def state(x=0.0, y=0.0, up=1.0, speed=0.0):
    values = np.zeros(13)
    values[:2], values[7] = (x, y), speed
    values[3], values[6] = (0.0, 1.0) if up > 0 else (1.0, 0.0)
    return values


def test_trajectories_have_their_length_order_and_terrain(collected):
    _, trajectories = collected
    assert [t.index for t in trajectories] == list(range(2 * SHARD_SIZE))
    for t in trajectories:
        assert t.states.shape == (STEPS + 1, 13)
        assert t.states.dtype == np.float32
        assert t.actions.shape == (STEPS, 2)
        assert np.hypot(*t.states[0, :2]) < 0.2
    t = trajectories[3]
    assert checksum(t.ground.heights) == t.ground.checksum
    assert len({t.ground.seed for t in trajectories}) == len(trajectories)
    assert set(discards(trajectories)) == {"stuck", "border", "rollover", "unstable"}


@pytest.fixture
def first_shard(collected, tmp_path):
    """Folder of a collection that was interrupted after its first shard."""
    path = COLLECTION.shard(tmp_path, 0)
    path.parent.mkdir(parents=True)
    return Path(shutil.copy(COLLECTION.shard(collected[0], 0), path))


def test_an_interrupted_collection_goes_on_and_ends_the_same(
    collected, first_shard, tmp_path
):
    _, whole = collected
    assert missing_shards(tmp_path, COLLECTION, 2 * SHARD_SIZE) == [1]
    # temporary file that a killed worker leaves
    stray = COLLECTION.folder(tmp_path) / ".shard-00001.npz.1.part"
    stray.write_bytes(b"half")
    rest = InOrder()
    repeated = collect(
        tmp_path, COLLECTION, 2 * SHARD_SIZE, executor=rest, progress=False
    )
    assert [arguments[2] for arguments in rest.submitted] == [1]
    assert digest(repeated) == digest(whole)


def test_other_processes_in_any_order_make_the_same(collected, tmp_path):
    _, whole = collected
    assert digest(
        collect(tmp_path, COLLECTION, SHARD_SIZE, workers=2, progress=False)
    ) == digest(whole[:SHARD_SIZE])


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
        "system": "system1",
        "role": "novice",
        "policy": "ornstein_uhlenbeck",
        "seed": 77,
    }
