"""Inputs and targets of the networks against closed forms, SciPy and the terrain."""

import math

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from sidm import rotations
from sidm.learning import encode_inputs, integrate, robot_centred_map, transition
from sidm.terrain import generate_terrain, height_at


def random_states(count: int, seed: int = 0, spread: float = 1.0) -> torch.Tensor:
    """States (count, 13), float64."""
    rng = np.random.default_rng(seed)
    position = rng.normal(0, spread, (count, 3))
    quaternion = Rotation.random(count, random_state=seed).as_quat()
    twist = rng.normal(size=(count, 6))
    return torch.from_numpy(np.hstack([position, quaternion, twist]))


def at(x=0.0, y=0.0, yaw=0.0) -> torch.Tensor:
    """State (13,) of a robot at rest."""
    turn = rotations.from_yaw(torch.tensor(yaw, dtype=torch.float64))
    place = turn.new_tensor([x, y, 0.0])
    return torch.cat([place, turn, turn.new_zeros(6)])


def test_inputs_are_scipys_up_direction_the_twist_and_the_action(generator):
    states = random_states(20)
    actions = torch.rand(20, 2, dtype=torch.float64, generator=generator)
    up = Rotation.from_quat(states[:, 3:7].numpy()).inv().apply([0, 0, 1])
    expected = torch.cat([torch.from_numpy(up), states[:, 7:], actions], dim=1)
    assert torch.allclose(encode_inputs(states, actions), expected)


def test_transition_of_a_drive_forward_and_a_left_turn():
    after = at(x=1.0, y=2.1, yaw=math.pi / 2 + 0.2)
    after[7:] = torch.arange(6)
    y = transition(at(x=1.0, y=2.0, yaw=math.pi / 2), after)
    expected = [0.1, 0, 0, 0, 0, math.sin(0.1), math.cos(0.1), 0, 1, 2, 3, 4, 5]
    assert torch.allclose(y, y.new_tensor(expected))


def test_transitions_are_scipys():
    before, after = random_states(30, 1), random_states(30, 2)
    y = transition(before, after)
    first, second = (Rotation.from_quat(s[:, 3:7].numpy()) for s in (before, after))
    assert np.allclose(y[:, :3], first.inv().apply((after - before)[:, :3].numpy()))
    assert np.allclose(y[:, 3:7], (first.inv() * second).as_quat(canonical=True))


@given(st.integers(0, 10_000), st.floats(0.1, 100), st.floats(0.1, 10))
def test_integrating_a_transition_gives_the_next_state(seed, spread, scale):
    """The length of a predicted quaternion does not matter."""
    before, after = random_states(4, seed, spread), random_states(4, seed + 1, spread)
    step = transition(before, after)
    step[:, 3:7] *= scale
    end = integrate(before, step)
    assert torch.allclose(end[:, :3], after[:, :3], atol=1e-9 * spread)
    turns = (rotations.canonical(states[:, 3:7]) for states in (end, after))
    assert torch.allclose(*turns, atol=1e-9)
    assert torch.equal(end[:, 7:], after[:, 7:])


@pytest.mark.parametrize(
    ("call", "sizes"),
    [
        (encode_inputs, (12, 2)),
        (encode_inputs, (13, 3)),
        (transition, (13, 5)),
        (integrate, (13, 11)),
    ],
)
def test_wrong_sizes_are_refused_with_both_shapes(call, sizes):
    with pytest.raises(ValueError, match=r"must have shape \(\.\.\., \d+\), not \("):
        call(*map(torch.zeros, sizes))


def test_maps_are_the_surface_that_the_wheels_touch(small_terrain):
    heights = np.stack([generate_terrain(small_terrain, seed) for seed in range(3)])
    states = random_states(6, 5, spread=1.5).reshape(3, 2, 13)
    together = robot_centred_map(heights, states, 16, size=5.0)
    offset = ((np.arange(16) + 0.5) / 16 - 0.5) * 5.0
    forward, left = offset[None, :], offset[:, None]
    for ground, some, maps in zip(heights, states.numpy(), together, strict=True):
        for state, found in zip(some, maps, strict=True):
            heading = Rotation.from_quat(state[3:7]).as_euler("ZYX")[0]
            cos, sin = math.cos(heading), math.sin(heading)
            x = state[0] + cos * forward - sin * left
            y = state[1] + sin * forward + cos * left
            expected = height_at(ground, x, y) - state[2]
            assert np.allclose(found, expected, atol=1e-12)


def test_a_map_covers_its_size_and_the_border_holds_beyond_it():
    line = 0.2 * (np.arange(101) - 50) * 0.1  # rises along x, over 10 m
    ramp = np.tile(line, (101, 1)).astype(np.float32)
    fine = robot_centred_map(ramp, at(), 300, size=3.0)
    assert fine[0, [0, -1]].tolist() == pytest.approx([-0.299, 0.299])
    beyond = robot_centred_map(ramp, at(x=50.0).float().numpy(), 4)
    assert beyond.shape == (4, 4) and beyond.dtype == torch.float32
    assert beyond.unique().tolist() == pytest.approx([0.2 * 5.0])


@pytest.mark.parametrize(
    ("heights", "states"),
    [((4, 5), (12,)), ((2, 9, 9), (3, 13)), ((9,), (13,)), ((4, 5), ())],
)
def test_wrong_map_shapes_give_both(heights, states):
    with pytest.raises(ValueError) as caught:
        robot_centred_map(torch.zeros(heights), torch.zeros(states), 8)
    assert str(heights) in str(caught.value) and str(states) in str(caught.value)
