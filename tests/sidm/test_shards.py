"""Shards on disk: round trip, damage, order; the nested split of the novice's pool."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sidm import shards
from sidm.config import ConfigError, replace
from sidm.drives import PROBES, GroundError, SimulatedGround, probe
from sidm.shards import SHARD_SIZE, Collection, ShardError, novice_split
from sidm.storage import checksum, read_arrays, write_arrays
from sidm.systems import SYSTEMS
from sidm.terrain import generate_terrain

COLLECTION = Collection(system="system1", role="novice")
TERRAIN = SYSTEMS["system1"].terrain
minutes = st.floats(0.1, 60)


def fill(root, drives):
    """Write shards of drives."""
    for number, first in enumerate(range(0, len(drives), SHARD_SIZE)):
        path = COLLECTION.shard(root, number)
        shards.write_shard(path, drives[first : first + SHARD_SIZE])


def test_what_is_written_is_read_without_pickle(
    tmp_path, make_trajectories, small_terrain
):
    made = make_trajectories(2 * SHARD_SIZE)
    made[1] = replace(made[1], discarded=(1, 0, 2, 0))
    fill(tmp_path, made)
    read = shards.load(tmp_path, COLLECTION, SHARD_SIZE + 1, small_terrain)
    assert len(read) == SHARD_SIZE + 1
    for before, after in zip(made, read, strict=False):
        assert np.array_equal(before.states, after.states)
        assert np.array_equal(before.actions, after.actions)
        assert np.array_equal(before.ground.probe, after.ground.probe)
        assert before.ground._replace(probe=0) == after.ground._replace(probe=0)
        assert (before.index, before.discarded) == (after.index, after.discarded)
    assert (
        shards.digest(read) == shards.digest(made[: len(read)]) != shards.digest(made)
    )
    files = sorted(COLLECTION.folder(tmp_path).iterdir())
    assert [path.name for path in files] == ["shard-00000.npz", "shard-00001.npz"]
    with np.load(files[0], allow_pickle=False) as data:
        assert all(data[name].dtype != object for name in data.files)


def test_a_damaged_foreign_or_missing_shard_is_named(tmp_path, make_trajectories):
    fill(tmp_path, make_trajectories(SHARD_SIZE))
    path = COLLECTION.shard(tmp_path, 0)
    with pytest.raises(ShardError, match="shard-00001.npz.*collect"):
        shards.load(tmp_path, COLLECTION, SHARD_SIZE + 1)
    members = read_arrays(path)
    write_arrays(path, members | {"states": members["states"][:, :-1]})
    with pytest.raises(ShardError, match=r"states .* not \(6, 13\) and"):
        shards.read_shard(path, TERRAIN)
    path.write_bytes(path.read_bytes()[:500])
    with pytest.raises(ShardError, match="damaged.*delete it") as caught:
        shards.read_shard(path, TERRAIN)
    assert str(path) in str(caught.value) and "\n" not in str(caught.value)


@pytest.mark.parametrize("name", ["system", "role", "policy"])
def test_a_collection_does_not_lead_out_of_its_folder(name):
    values = {"system": "system1", "role": "novice"} | {name: "../elsewhere"}
    with pytest.raises(ConfigError, match=f"Collection.{name} must be a plain name"):
        Collection(**values)
    with pytest.raises(ConfigError, match="seed must not be negative"):
        Collection(system="system1", role="novice", seed=-1)


def test_a_ground_is_known_again_but_for_rounding():
    heights = generate_terrain(TERRAIN, 5)
    assert len(set(probe(heights))) == PROBES
    driven = SimulatedGround(TERRAIN, 5, "", probe(heights * (1 + 1e-12)))
    assert np.array_equal(driven.heights, heights)
    for other in (
        driven._replace(seed=6),
        driven._replace(terrain=replace(TERRAIN, smoothing=0.701)),
        driven._replace(probe=driven.probe + 1e-5),
    ):
        with pytest.raises(GroundError, match="no longer the one that was driven on"):
            _ = other.heights


def test_checksum_sees_values_shape_and_type():
    array = np.arange(6.0)
    assert checksum(array) == checksum(array.copy())
    others = (array, array.reshape(2, 3), array.astype("f4"), np.nextafter(array, 9))
    assert len({checksum(other) for other in others}) == 4


@given(minutes, minutes, st.integers(0, 1000))
def test_a_split_is_three_to_one_and_lies_in_that_of_more_minutes(few, many, seed):
    few, many = sorted((few, many))
    small, large = (tuple(map(set, novice_split(600, m, seed))) for m in (few, many))
    assert small[0] <= large[0] and small[1] <= large[1]
    train, test = novice_split(600, few, seed)
    count = len({*train, *test})
    assert len(train) + len(test) == count == shards.trajectories_for(few)
    assert len(train) >= 1 and len(test) >= 1 and abs(len(test) - count / 4) <= 0.5
    assert 0 <= min(*train, *test) and max(*train, *test) < 600


def test_a_split_depends_on_the_seed_and_needs_a_pool():
    first, repeated, other = (novice_split(100, 5, k)[0].tolist() for k in (0, 0, 1))
    assert first == repeated != other
    assert shards.trajectories_for(0.01) == 2 and shards.trajectories_for(120) == 1125
    with pytest.raises(ConfigError, match="are 47 trajectories, but the pool has 20"):
        novice_split(20, 5, 0)
