"""Tensors from drives, parts of windows, standardisation."""

import numpy as np
import pytest
import torch

from sidm.body import ROVER
from sidm.config import replace
from sidm.drives import Drive, Ground
from sidm.learning import Standardisation, observation, windows_of
from sidm.learning.model import DynamicsModel
from sidm.learning.units import loss_weights
from sidm.terrain import generate_terrain
from tests.ownrobot.cart import CART


def test_windows_are_what_the_networks_see_of_drives(small_terrain, make_trajectories):
    drives = make_trajectories(3)
    motion, drive = windows_of(drives, 8), drives[1]
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


def test_ground_may_have_its_middle_anywhere(rng):
    heights = np.tile(np.linspace(0, 10, 101), (101, 1))  # rises along x
    states = np.zeros((5, 13))
    states[:, 2], states[:, 6] = 5.0, 1.0
    maps = []
    for x in (0.0, 100.0):
        ground = Ground(heights, 0.1, (x, -x))
        moved = states + x * np.eye(13)[0] - x * np.eye(13)[1]
        drive = Drive(moved, np.zeros((4, 2)), ROVER, ground)
        maps.append(windows_of([drive], 8).maps)
    assert torch.equal(*maps) and maps[0].std() > 1


def test_parts_of_windows_are_the_same_copied_or_not(make_motion):
    motion, chosen = make_motion(7), [4, 1, 5, 0]
    part, copy = motion.subset(chosen), motion.take(np.array(chosen))
    assert part.stored_maps is motion.stored_maps
    assert torch.equal(copy.inputs, motion.inputs[chosen])
    mask = np.array([True, False, False, True, False, False, False])
    assert torch.equal(motion.subset(mask).inputs, motion.inputs[[0, 3]])
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
