"""Tensors from drives, the cache of maps, parts of windows, standardisation."""

from pathlib import Path

import numpy as np
import pytest
import torch

from sidm.body import ROVER
from sidm.config import replace
from sidm.learning import Standardisation, Windows, dataset, observation, windows_of
from sidm.learning.model import DynamicsModel
from sidm.learning.units import loss_weights
from sidm.shards import SHARD_SIZE, ShardError
from sidm.terrain import generate_terrain
from tests.ownrobot.cart import CART
from tests.sidm.test_shards import COLLECTION, fill


@pytest.fixture
def drives(make_trajectories):
    return make_trajectories(2 * SHARD_SIZE)


@pytest.fixture
def stored(tmp_path, drives, small_terrain):
    """A function that loads windows of the drives, which are on disk."""
    fill(tmp_path, drives)

    def load(count: int, pixels: int = 8) -> Windows:
        return dataset.load_windows(tmp_path, COLLECTION, count, small_terrain, pixels)

    return load


def cached(root):
    return list(COLLECTION.folder(root).glob("maps-*.npy"))


def test_windows_are_what_the_networks_see_of_drives(small_terrain, drives):
    motion, drive = windows_of(drives[:3], 8), drives[1]
    assert (len(motion), motion.maps.dtype) == (3, torch.float16)
    states, actions = (
        torch.from_numpy(part).double() for part in (drive.states, drive.actions)
    )
    heights = generate_terrain(small_terrain, 1)
    # three together round otherwise, and float32 more than both
    for found, expected, error in (
        (motion.inputs, observation.encode_inputs(states[:-1], actions), 1e-6),
        (motion.targets, observation.transition(states[:-1], states[1:]), 1e-6),
        (motion.maps, observation.robot_centred_map(heights, states[:-1], 8), 2e-3),
    ):
        assert torch.allclose(found[1].double(), expected, atol=error)


def test_loaded_windows_are_those_of_the_drives_and_maps_are_computed_once(
    stored, drives, tmp_path, monkeypatch
):
    expected = windows_of(drives[: SHARD_SIZE + 1], 8)
    for _ in range(2):  # the file is made, then read
        motion = stored(SHARD_SIZE + 1)
        for name in ("inputs", "targets", "maps"):
            assert torch.equal(getattr(motion, name), getattr(expected, name))
        build = "sidm.terrain.generate_terrain"
        monkeypatch.setattr(build, lambda *_: pytest.fail("built a terrain again"))
    (path,) = cached(tmp_path)
    mapped = Path("/proc/self/maps")  # maps stay in their file
    assert not mapped.exists() or path.name in mapped.read_text()
    before = path.read_bytes()
    motion.maps.zero_()
    assert path.read_bytes() == before


def test_each_resolution_and_count_has_its_file(stored, tmp_path):
    for count, pixels in ((3, 8), (3, 7), (4, 8)):
        assert stored(count, pixels).maps.shape == (count, 6, pixels, pixels)
    assert len(cached(tmp_path)) == 3


@pytest.mark.parametrize("content", [b"", b"not an array", b"\x93NUMPY\x01\x00"])
def test_damaged_maps_are_named(stored, tmp_path, content):
    stored(2)
    (path,) = cached(tmp_path)
    path.write_bytes(content)
    with pytest.raises(ShardError, match="maps-8-.*damaged.*delete the file") as error:
        stored(2)
    assert "\n" not in str(error.value)
    np.save(path, np.zeros((1, 2), np.float16))
    with pytest.raises(ShardError, match=r"maps \(1, 2\) where \(2, 6, 8, 8\)"):
        stored(2)


def test_parts_of_windows_are_the_same_copied_or_not(make_motion):
    motion, chosen = make_motion(7), [4, 1, 5, 0]
    part, copy = motion.subset(chosen), motion.take(np.array(chosen))
    assert part.stored_maps is motion.stored_maps
    assert torch.equal(copy.inputs, motion.inputs[chosen])
    assert torch.equal(part.inputs, copy.inputs)
    assert torch.equal(part.targets, copy.targets)
    assert torch.equal(torch.cat([chunk.maps for chunk in part.split(3)]), copy.maps)
    assert torch.equal(part.first(2).take([1]).maps, motion.maps[[1]])
    assert [len(chunk) for chunk in motion.split(3)] == [3, 3, 1]
    assert len(motion.first(3)) == 3 and len(motion.first(30)) == 7


def test_standardisation_is_numpys_mean_and_deviation(make_motion):
    motion = make_motion(9)
    motion.targets[..., 4] = motion.inputs[..., 3] = 0.25
    units = Standardisation.fit(motion)
    for found, values in (
        (units.input_mean, motion.inputs.numpy().mean((0, 1))),
        (units.input_std[4:], motion.inputs.numpy().std((0, 1))[4:]),
        (units.target_std[:4], motion.targets.numpy().std((0, 1))[:4]),
        (units.map_mean, motion.maps.float().numpy().mean()),
        (units.map_std, motion.maps.float().numpy().std()),
    ):
        assert np.allclose(found, values, atol=1e-6) and found.dtype == torch.float32
    assert units.input_std[3] == 1  # constant: in its raw unit
    assert units.target_std[4] == 0
    few, first = Standardisation.fit(motion, 2), Standardisation.fit(motion.first(2))
    assert torch.equal(few.map_std, first.map_std)


@pytest.mark.parametrize("size, weight", [(0.0, 0), (5e-5, 0), (2e-4, 2.5e7)])
def test_components_that_no_sensor_resolves_have_no_weight(size, weight):
    """`left` of a planar pose, m, whose sensor resolves 0.1 mm; 1/size^2 above that."""
    units, body = Standardisation.none(CART), CART
    units.target_std[body.targets.index("left")] = size
    weights = dict(zip(body.targets, loss_weights(body, units).tolist(), strict=True))
    assert weights.pop("left") == pytest.approx(weight)
    assert set(weights.values()) == {1.0}


def test_a_constant_component_is_predicted_as_its_mean(make_motion, small_network):
    motion = make_motion(9)
    motion.targets[..., 4] = 0.25
    body = replace(ROVER, name="weighted", weights="variance")
    network = replace(small_network, novice_body=body)
    model = DynamicsModel(network, Standardisation.fit(motion), roles=["novice"])
    predicted, _ = model("novice", motion.inputs, motion.maps)
    assert (predicted[..., 4] == 0.25).all() and predicted[..., 3].std() > 0
    assert model.loss_weights("novice")[4] == 0
