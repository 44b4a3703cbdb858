"""Shards on disk: round trip, damage, order."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sidm.config import ConfigError, replace
from sidm.drives import PROBES, STEPS, GroundError, SimulatedGround, probe
from sidm.shards import (
    SHARD_SIZE,
    Collection,
    ShardError,
    digest,
    load,
    read_shard,
    simulated_drive,
    trajectories_for,
    write_shard,
)
from sidm.storage import checksum, read_arrays, write_arrays
from sidm.systems import SYSTEMS
from sidm.terrain import generate_terrain

COLLECTION = Collection(system="system1", role="novice")
TERRAIN = SYSTEMS["system1"].terrain


def some_trajectories(first, count):
    rng = np.random.default_rng(first)
    return [
        simulated_drive(
            "rover",
            i,
            rng.normal(size=(STEPS + 1, 13)).astype(np.float32),
            rng.uniform(-1, 1, (STEPS, 2)).astype(np.float32),
            SimulatedGround(
                TERRAIN, 2**62 - 1 - i, f"{i:016x}", rng.uniform(0, 2, PROBES)
            ),
            (i, 0, 1, 0),
        )
        for i in range(first, first + count)
    ]


def fill(root, shards):
    made = [some_trajectories(SHARD_SIZE * k, SHARD_SIZE) for k in range(shards)]
    for k, trajectories in enumerate(made):
        write_shard(COLLECTION.shard(root, k), trajectories)
    return [t for shard in made for t in shard]


def test_what_is_written_is_read(tmp_path):
    made = fill(tmp_path, 2)
    read = load(tmp_path, COLLECTION, SHARD_SIZE + 1)
    assert len(read) == SHARD_SIZE + 1
    for before, after in zip(made, read, strict=False):
        assert np.array_equal(before.states, after.states)
        assert np.array_equal(before.actions, after.actions)
        assert np.array_equal(before.ground.probe, after.ground.probe)
        assert before.ground._replace(probe=0) == after.ground._replace(probe=0)
        assert (before.index, before.discarded) == (after.index, after.discarded)
    assert digest(read) == digest(made[: len(read)]) != digest(made)


def test_no_shard_needs_pickle_and_no_temporary_file_stays(tmp_path):
    fill(tmp_path, 1)
    folder = COLLECTION.folder(tmp_path)
    assert [path.name for path in folder.iterdir()] == ["shard-00000.npz"]
    with np.load(folder / "shard-00000.npz", allow_pickle=False) as data:
        assert all(data[name].dtype != object for name in data.files)


@given(where=st.floats(0, 1, exclude_max=True), bit=st.integers(0, 7))
def test_every_flipped_bit_is_seen_and_the_file_named(tmp_path, where, bit):
    fill(tmp_path, 1)
    path = COLLECTION.shard(tmp_path, 0)
    data = bytearray(path.read_bytes())
    data[int(where * len(data))] ^= 1 << bit
    path.write_bytes(data)
    with pytest.raises(ShardError, match="damaged") as caught:
        read_shard(path, TERRAIN)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)
    assert "delete it" in str(caught.value)


def test_a_collection_does_not_lead_out_of_its_folder():
    for name in ("system", "role", "policy"):
        with pytest.raises(
            ConfigError,
            match=f"Collection.{name} must be a plain name, not '../elsewhere'",
        ):
            Collection(
                **({"system": "system1", "role": "novice"} | {name: "../elsewhere"})
            )
    with pytest.raises(ConfigError, match="seed must not be negative"):
        Collection(system="system1", role="novice", seed=-1)


def test_a_truncated_shard_is_found(tmp_path):
    fill(tmp_path, 1)
    path = COLLECTION.shard(tmp_path, 0)
    path.write_bytes(path.read_bytes()[:500])
    with pytest.raises(ShardError, match="damaged"):
        read_shard(path, TERRAIN)


def test_columns_that_do_not_belong_together_are_found(tmp_path):
    path = COLLECTION.shard(tmp_path, 0)
    write_shard(path, some_trajectories(0, 2))
    members = read_arrays(path)
    write_arrays(path, members | {"states": members["states"][:, :-1]})
    with pytest.raises(
        ShardError, match=r"states has shape \(2, 64, 13\), not \(2, 65, 13\)"
    ):
        read_shard(path, TERRAIN)


def test_a_missing_shard_is_named(tmp_path):
    fill(tmp_path, 1)
    with pytest.raises(ShardError, match="shard-00001.npz.*collect"):
        load(tmp_path, COLLECTION, SHARD_SIZE + 1)


def test_a_ground_is_known_again_but_for_rounding():
    heights = generate_terrain(TERRAIN, 5)
    assert probe(heights).shape == (PROBES,) and len(set(probe(heights))) == PROBES
    driven = SimulatedGround(TERRAIN, 5, "", probe(heights * (1 + 1e-12)))
    assert np.array_equal(driven.heights, heights)
    for other in (
        driven._replace(seed=6),
        driven._replace(terrain=replace(TERRAIN, smoothing=0.701)),
    ):
        with pytest.raises(
            GroundError, match="is no longer the one that was driven on"
        ):
            _ = other.heights


def test_checksum_sees_values_shape_and_type():
    array = np.arange(6.0)
    assert checksum(array) == checksum(array.copy())
    others = (array, array.reshape(2, 3), array.astype("f4"), np.nextafter(array, 9))
    assert len({checksum(other) for other in others}) == 4


@pytest.mark.parametrize(
    ("minutes", "count"), [(0.01, 2), (1, 9), (5, 47), (120, 1125)]
)
def test_minutes_to_trajectories(minutes, count):
    assert trajectories_for(minutes) == count
