"""Collection: actions, rules of an episode, resuming, independence of workers."""

import shutil
from concurrent.futures import Executor, Future, ThreadPoolExecutor

import numpy as np
import pytest

import sidm
from sidm.config import ConfigError, replace
from sidm.drives import STEPS
from sidm.pool import process_pool
from sidm.shards import SHARD_SIZE, Collection, ShardError, digest
from sidm.simulation import POLICIES, Simulator, collect, collecting, draw_actions
from sidm.simulation.collecting import EpisodeRules, draw_attempt, simulate_trajectory
from sidm.storage import checksum
from sidm.systems import SYSTEMS, System, Terrain
from sidm.terrain import generate_terrain

COLLECTION = Collection(system="system1", role="novice", seed=77)
OWN = System(
    name="mine",
    novice=SYSTEMS["system1"].novice.replace(spring=20_000.0, throttle_scale=20.0),
    expert=SYSTEMS["system2"].expert,
    terrain=Terrain(cell_height_scale=0.1, size=120),
)


class InOrder(Executor):
    """Executor that runs each shard at once, in this process."""

    def __init__(self):
        self.submitted = []

    def submit(self, call, *arguments):
        self.submitted.append(arguments)
        future = Future()
        future.set_result(call(*arguments))
        return future


def gather(root, count, **how):
    return collect(root, COLLECTION, count, progress=False, **how)


@pytest.fixture(scope="module")
def collected(tmp_path_factory):
    """Two shards that this process collected: their folder and their drives."""
    root = tmp_path_factory.mktemp("data")
    return root, gather(root, 2 * SHARD_SIZE, executor=InOrder())


def test_drives_are_in_order_and_each_has_its_terrain(collected):
    _, drives = collected
    assert [drive.index for drive in drives] == list(range(2 * SHARD_SIZE))
    assert {len(drive) for drive in drives} == {STEPS}
    assert max(np.hypot(*drive.states[0, :2]) for drive in drives) < 0.2
    assert checksum(drives[3].ground.heights) == drives[3].ground.checksum
    assert len({drive.ground.seed for drive in drives}) == len(drives)


def test_an_interrupted_collection_goes_on_and_ends_the_same(collected, tmp_path):
    root, whole = collected
    COLLECTION.folder(tmp_path).mkdir(parents=True)
    shutil.copy(COLLECTION.shard(root, 0), COLLECTION.folder(tmp_path))
    rest = InOrder()
    repeated = gather(tmp_path, 2 * SHARD_SIZE, executor=rest)
    assert [arguments[2] for arguments in rest.submitted] == [1]
    assert digest(repeated) == digest(whole)


def test_other_processes_make_the_same(collected, tmp_path):
    _, whole = collected
    with process_pool(1) as pool:
        drives = gather(tmp_path, SHARD_SIZE, executor=pool)
    assert digest(drives) == digest(whole[:SHARD_SIZE])


def test_robots_of_ones_own_drive_in_their_own_role(tmp_path):
    collection, how = replace(COLLECTION, system="mine"), dict(executor=InOrder())
    (drive,) = collect(tmp_path, collection, 1, progress=False, system=OWN, **how)
    seed, yaw, actions = draw_attempt(collection, 0, sum(drive.discarded))
    with Simulator(OWN.novice, generate_terrain(OWN.terrain, seed)) as simulator:
        states = [simulator.reset(0.0, 0.0, yaw), *map(simulator.step, actions)]
    assert np.array_equal(drive.states, np.array(states, np.float32))


def test_a_name_stands_for_one_pair(tmp_path):
    own, swapped = replace(COLLECTION, system="mine"), replace(OWN, expert=OWN.novice)
    with pytest.raises(ConfigError, match="unknown system 'mine'"):
        simulate_trajectory(own, 0)
    with pytest.raises(ConfigError, match="'system1', the robots given are of 'mine'"):
        simulate_trajectory(COLLECTION, 0, OWN)
    with pytest.raises(ConfigError, match="'system1' is known with other robots"):
        simulate_trajectory(COLLECTION, 0, replace(OWN, name="system1"))
    for _ in range(2):
        collect(tmp_path, own, 0, progress=False, system=OWN)
    with pytest.raises(ConfigError, match="has motion of other robots called 'mine'"):
        collect(tmp_path, own, 0, progress=False, system=swapped)


def state(x=0.0, y=0.0, up=1.0, speed=0.0):
    values = np.zeros(13)
    values[:2], values[7] = (x, y), speed
    values[3], values[6] = (0.0, 1.0) if up > 0 else (1.0, 0.0)
    return values


def test_threads_do_not_share_a_simulator_and_none_is_left(tmp_path):
    """A simulator that stays open would be the one of the user's own PyBullet calls."""

    def drives(seed):
        made = sidm.simulate("system1", "novice", 0.2, seed=seed, progress=False)
        return [drive.states for drive in made]

    alone = [drives(seed) for seed in (0, 1)]
    with ThreadPoolExecutor(2) as pool:
        assert np.array_equal(list(pool.map(drives, (0, 1))), alone)
    assert collecting.kept.simulator is None


def test_a_damaged_description_of_robots_is_named(tmp_path):
    folder = Collection(system="mine", role="novice", seed=1).folder(tmp_path)
    folder.mkdir(parents=True)
    (folder / "system.json").write_text("{}")
    with pytest.raises(ShardError, match="system.json: damaged .* delete its folder"):
        sidm.simulate(OWN, "novice", 0.2, seed=1, folder=tmp_path, progress=False)


def test_border_rollover_instability_and_standing_still_end_an_episode():
    for where, cause in (
        ({"x": 13.9}, None),
        ({"y": -14.0}, "border"),
        ({"up": -1}, "rollover"),
        ({"speed": 15.1}, "unstable"),
        ({"x": np.nan}, "unstable"),
    ):
        assert EpisodeRules(state(), 14.95).ended(state(**where)) == cause
    still, slow = EpisodeRules(state(), 14.95), EpisodeRules(state(), 14.95)
    assert [still.ended(state(x=0.05)) for _ in range(25)] == [None] * 25
    assert still.ended(state(x=0.05)) == "stuck"
    assert not any(slow.ended(state(x=0.11 * k)) for k in range(100))


@pytest.mark.parametrize("policy", POLICIES)
def test_actions_are_bounded_and_seeded_and_only_held_ones_stand_still(policy):
    drawn = [
        draw_actions(policy, 64, np.random.default_rng(seed)) for seed in (1, 1, 2)
    ]
    assert drawn[0].shape == (64, 2) and np.abs(drawn[0]).max() <= 1
    assert np.array_equal(drawn[0], drawn[1])
    assert not np.array_equal(drawn[0], drawn[2])
    assert (np.ptp(drawn[0], axis=0).max() == 0) == (policy == "held")


def test_ornstein_uhlenbeck_throttle_has_the_stated_mean_and_steering_wanders_widely():
    rngs = map(np.random.default_rng, range(60))
    actions = np.stack([draw_actions("ornstein_uhlenbeck", 64, rng) for rng in rngs])
    assert actions[..., 0].mean() == pytest.approx(0.2, abs=0.05)
    # an unclipped throttle has the stationary deviation 0.025 / sqrt(2 * 0.0125)
    deviation = 0.025 / np.sqrt(2 * 0.0125)
    assert actions[:, 20:, 0].std() == pytest.approx(deviation, rel=0.25)
    assert actions[:, -1, 1].std() > 0.5
    with pytest.raises(ConfigError, match="ornstein_uhlenbek.*ornstein_uhlenbeck"):
        draw_actions("ornstein_uhlenbek", 4, np.random.default_rng(0))
