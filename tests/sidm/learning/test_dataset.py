"""Tensors from trajectories, the cache of maps, the nested split, standardisation."""

from pathlib import Path

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from sidm.config import ConfigError, replace
from sidm.drives import GroundError
from sidm.learning import (
    Standardisation,
    Windows,
    encode_inputs,
    load_windows,
    robot_centred_map,
    transition,
    windows_of,
)
from sidm.shards import (
    SHARD_SIZE,
    Collection,
    ShardError,
    novice_split,
    trajectories_for,
    write_shard,
)
from sidm.terrain import generate_terrain

COLLECTION = Collection(system="system1", role="novice")


@pytest.fixture
def stored(tmp_path, make_trajectories):
    """A collection of two shards on disk: its folder and its trajectories."""
    trajectories = make_trajectories(2 * SHARD_SIZE)
    for number in range(2):
        write_shard(
            COLLECTION.shard(tmp_path, number),
            trajectories[number * SHARD_SIZE : (number + 1) * SHARD_SIZE],
        )
    return tmp_path, trajectories


def cached(root):
    return list(COLLECTION.folder(root).glob("maps-*.npy"))


def test_windows_of_drives(small_terrain, make_trajectories):
    trajectories = make_trajectories(3)
    motion = windows_of(trajectories, 8)
    assert len(motion) == 3
    expected = ((3, 6, 11), (3, 6, 13), (3, 6, 8, 8))
    assert (motion.inputs.shape, motion.targets.shape, motion.maps.shape) == expected
    assert (motion.inputs.dtype, motion.targets.dtype, motion.maps.dtype) == (
        torch.float32,
    ) * 2 + (torch.float16,)
    states, actions = (
        torch.from_numpy(part).double()
        for part in (trajectories[1].states, trajectories[1].actions)
    )
    # One trajectory in float64 is the reference; three together round otherwise, and
    # float32 rounds more than both.
    assert torch.allclose(
        motion.inputs[1].double(), encode_inputs(states[:-1], actions), atol=1e-6
    )
    assert torch.allclose(
        motion.targets[1].double(), transition(states[:-1], states[1:]), atol=1e-6
    )
    maps = robot_centred_map(generate_terrain(small_terrain, 1), states[:-1], 8)
    assert torch.allclose(motion.maps[1].double(), maps, atol=2e-3)


def test_another_terrain_is_refused(small_terrain, make_trajectories):
    trajectories = make_trajectories(2)
    ground = trajectories[1].ground
    trajectories[1] = replace(
        trajectories[1], ground=ground._replace(probe=ground.probe + 1e-5)
    )
    with pytest.raises(
        GroundError, match="terrain 1 is no longer the one that was driven on"
    ) as caught:
        windows_of(trajectories, 8)
    assert "\n" not in str(caught.value)


def test_loaded_windows_are_those_of_what_lies_on_disk(stored, small_terrain):
    root, trajectories = stored
    count = SHARD_SIZE + 1
    expected = windows_of(trajectories[:count], 8)
    for _ in range(2):  # the file is made, then read
        motion = load_windows(root, COLLECTION, count, small_terrain, 8)
        for name in ("inputs", "targets", "maps"):
            assert torch.equal(getattr(motion, name), getattr(expected, name))


def test_maps_are_computed_once(stored, small_terrain, monkeypatch):
    root, _ = stored
    load_windows(root, COLLECTION, 3, small_terrain, 8)
    monkeypatch.setattr(
        "sidm.terrain.generate_terrain", lambda *_: pytest.fail("built a terrain again")
    )
    load_windows(root, COLLECTION, 3, small_terrain, 8)


def test_each_resolution_and_count_has_its_file(stored, small_terrain):
    root, _ = stored
    for count, pixels in ((3, 8), (3, 7), (4, 8)):
        assert load_windows(
            root, COLLECTION, count, small_terrain, pixels
        ).maps.shape == (count, 6, pixels, pixels)
    assert len(cached(root)) == 3


def test_reading_leaves_the_cache_unharmed(stored, small_terrain):
    root, _ = stored
    motion = load_windows(root, COLLECTION, 2, small_terrain, 8)
    before = cached(root)[0].read_bytes()
    motion.maps.zero_()
    assert cached(root)[0].read_bytes() == before


@pytest.mark.parametrize("content", [b"", b"not an array", b"\x93NUMPY\x01\x00"])
def test_damaged_maps_are_named(stored, small_terrain, content):
    root, _ = stored
    load_windows(root, COLLECTION, 2, small_terrain, 8)
    cached(root)[0].write_bytes(content)
    with pytest.raises(ShardError, match="maps-8-.*delete the file") as caught:
        load_windows(root, COLLECTION, 2, small_terrain, 8)
    assert "\n" not in str(caught.value)


def test_maps_of_another_shape_are_named(stored, small_terrain):
    root, _ = stored
    load_windows(root, COLLECTION, 2, small_terrain, 8)
    np.save(cached(root)[0], np.zeros((1, 2), np.float16))
    with pytest.raises(ShardError, match=r"maps \(1, 2\) where \(2, 6, 8, 8\)"):
        load_windows(root, COLLECTION, 2, small_terrain, 8)


def test_take_first_and_split(make_motion):
    motion = make_motion(7)
    assert torch.equal(motion.take(np.array([4, 1])).inputs, motion.inputs[[4, 1]])
    assert len(motion.first(3)) == 3 and len(motion.first(30)) == 7
    parts = list(motion.split(3))
    assert [len(part) for part in parts] == [3, 3, 1]
    assert torch.equal(torch.cat([part.maps for part in parts]), motion.maps)


def test_a_part_is_what_take_copies(make_motion):
    motion, chosen = make_motion(7), [4, 1, 5, 0]
    part, copy = motion.subset(chosen), motion.take(chosen)
    assert len(part) == 4
    assert torch.equal(part.inputs, copy.inputs)
    assert torch.equal(part.targets, copy.targets)
    assert torch.equal(torch.cat([chunk.maps for chunk in part.split(3)]), copy.maps)
    assert torch.equal(part.first(2).take([1]).maps, motion.maps[[1]])


def anonymous_memory() -> float:
    """Memory of this process that no file backs, MiB."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return (
        next(int(line.split()[1]) for line in lines if line.startswith("RssAnon"))
        / 1024
    )


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="needs Linux")
def test_maps_stay_in_their_file(tmp_path):
    """Reading from 96 MiB of maps needs memory for a batch, not for the maps.

    A batch of half of the maps is 1.5 MiB, the half itself 48 MiB; the allocator needs
    the rest.
    """
    count, steps, pixels, batch = 192, 64, 64, 3
    np.save(tmp_path / "maps.npy", np.ones((count, steps, pixels, pixels), np.float16))
    maps = torch.from_numpy(np.load(tmp_path / "maps.npy", mmap_mode="c"))
    motion = Windows(torch.zeros(count, steps, 11), torch.zeros(count, steps, 13), maps)
    part = motion.subset(range(0, count, 2))
    part.take(range(batch))
    before = anonymous_memory()
    assert (
        sum(
            float(part.take(range(start, start + batch)).maps[0, 0, 0, 0])
            for start in range(64)
        )
        == 64
    )
    assert sum(len(chunk) for chunk in part.split(batch)) == count // 2
    assert anonymous_memory() - before < 16


minutes = st.floats(0.1, 60)


@given(minutes, minutes, st.integers(0, 1000))
def test_smaller_subsets_lie_in_larger_ones(few, many, seed):
    few, many = sorted((few, many))
    small, large = (tuple(map(set, novice_split(600, m, seed))) for m in (few, many))
    assert small[0] <= large[0] and small[1] <= large[1]


@given(minutes, st.integers(0, 1000))
def test_split_is_three_to_one_of_whole_trajectories(amount, seed):
    train, test = novice_split(600, amount, seed)
    count = trajectories_for(amount)
    assert len(train) + len(test) == count == len({*train, *test})
    assert len(train) >= 1 and len(test) >= 1 and abs(len(test) - count / 4) <= 0.5
    assert 0 <= min(*train, *test) and max(*train, *test) < 600


def test_split_depends_on_the_seed_alone():
    first, repeated, other = (
        novice_split(100, 5, seed)[0].tolist() for seed in (0, 0, 1)
    )
    assert first == repeated != other


def test_split_of_too_small_a_pool():
    with pytest.raises(
        ConfigError, match="5 novice minutes are 47 trajectories, but the pool has 20"
    ):
        novice_split(20, 5, 0)


def test_standardisation_against_numpy(make_motion):
    motion = make_motion(9)
    motion.targets[..., 4] = 0.25
    units = Standardisation.fit(motion)
    assert np.allclose(units.input_mean, motion.inputs.numpy().mean((0, 1)), atol=1e-6)
    assert np.allclose(units.input_std, motion.inputs.numpy().std((0, 1)), atol=1e-6)
    assert np.allclose(
        units.target_std[:4], motion.targets.numpy().std((0, 1))[:4], atol=1e-6
    )
    assert np.allclose(units.map_mean, motion.maps.float().mean(), atol=1e-6)
    assert np.allclose(units.map_std, motion.maps.float().numpy().std(), atol=1e-6)
    assert units.map_std.shape == ()
    assert (units.input_mean.dtype, units.map_std.dtype) == (torch.float32,) * 2
    assert units.target_std[4] == 1  # constant: in its raw unit


def test_standardisation_from_part_of_the_maps(make_motion):
    motion = make_motion(9)
    assert torch.equal(
        Standardisation.fit(motion, maps_from=2).map_std,
        Standardisation.fit(motion.first(2)).map_std,
    )
