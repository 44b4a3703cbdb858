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
    quaternion = Rotation.random(count, random_state=seed).as_quat()
    return torch.from_numpy(
        np.hstack(
            [rng.normal(0, spread, (count, 3)), quaternion, rng.normal(size=(count, 6))]
        )
    )


def at(x=0.0, y=0.0, z=0.0, yaw=0.0) -> torch.Tensor:
    """State (13,) of a robot at rest."""
    turn = rotations.from_yaw(torch.tensor(yaw, dtype=torch.float64))
    return torch.cat(
        [
            torch.tensor([x, y, z], dtype=torch.float64),
            turn,
            torch.zeros(6, dtype=torch.float64),
        ]
    )


def test_inputs_against_scipy(generator):
    states = random_states(20)
    actions = torch.rand(20, 2, dtype=torch.float64, generator=generator)
    inputs = encode_inputs(states, actions)
    up = Rotation.from_quat(states[:, 3:7].numpy()).inv().apply([0, 0, 1])
    assert np.allclose(inputs[:, :3], up)
    assert torch.equal(inputs[:, 3:9], states[:, 7:])
    assert torch.equal(inputs[:, 9:], actions)


def test_transition_of_a_drive_forward_and_a_left_turn():
    after = at(x=1.0, y=2.1, yaw=math.pi / 2 + 0.2)
    after[7:] = torch.arange(6)
    y = transition(at(x=1.0, y=2.0, yaw=math.pi / 2), after)
    expected = [0.1, 0, 0, 0, 0, math.sin(0.1), math.cos(0.1), 0, 1, 2, 3, 4, 5]
    assert torch.allclose(y, torch.tensor(expected, dtype=torch.float64))


def test_transition_against_scipy():
    before, after = random_states(30, 1), random_states(30, 2)
    y = transition(before, after)
    first, second = (Rotation.from_quat(s[:, 3:7].numpy()) for s in (before, after))
    assert np.allclose(y[:, :3], first.inv().apply((after - before)[:, :3].numpy()))
    assert np.allclose(y[:, 3:7], (first.inv() * second).as_quat(canonical=True))
    assert (y[:, 6] >= 0).all()


@given(st.integers(0, 10_000), st.floats(0.1, 100))
def test_integrating_a_transition_gives_the_next_state(seed, spread):
    before, after = random_states(4, seed, spread), random_states(4, seed + 1, spread)
    end = integrate(before, transition(before, after))
    assert torch.allclose(end[:, :3], after[:, :3], atol=1e-9 * spread)
    assert torch.allclose(
        rotations.canonical(end[:, 3:7]), rotations.canonical(after[:, 3:7]), atol=1e-9
    )
    assert torch.equal(end[:, 7:], after[:, 7:])


def test_integrate_normalises_the_predicted_quaternion():
    before = random_states(5)
    step = transition(random_states(5, 1), random_states(5, 2))
    scaled = step.clone()
    scaled[:, 3:7] *= 3.0
    assert torch.allclose(integrate(before, scaled), integrate(before, step))
    assert torch.allclose(
        integrate(before, scaled)[:, 3:7].norm(dim=-1),
        torch.ones(5, dtype=torch.float64),
    )


@pytest.mark.parametrize(
    "call",
    [
        lambda: encode_inputs(torch.zeros(12), torch.zeros(2)),
        lambda: encode_inputs(torch.zeros(13), torch.zeros(3)),
        lambda: transition(torch.zeros(13), torch.zeros(5)),
        lambda: integrate(torch.zeros(13), torch.zeros(11)),
    ],
)
def test_wrong_sizes_are_refused_with_both_shapes(call):
    with pytest.raises(ValueError, match=r"must have shape \(\.\.\., \d+\), not \("):
        call()


def ramp(forward: float, left: float) -> torch.Tensor:
    """A plane with these slopes along world x and y; (101, 101), 10 m a side."""
    line = (torch.arange(101, dtype=torch.float64) - 50) * 0.1
    return forward * line[None, :] + left * line[:, None]


def test_map_is_the_surface_that_the_wheels_touch(small_terrain):
    heights = generate_terrain(small_terrain, 3)
    states = random_states(6, 5, spread=1.5)
    maps = robot_centred_map(heights, states, 16, size=5.0)
    offset = ((np.arange(16) + 0.5) / 16 - 0.5) * 5.0
    for state, picture in zip(states.numpy(), maps.numpy(), strict=True):
        heading = Rotation.from_quat(state[3:7]).as_euler("ZYX")[0]
        x = (
            state[0]
            + math.cos(heading) * offset[None, :]
            - math.sin(heading) * offset[:, None]
        )
        y = (
            state[1]
            + math.sin(heading) * offset[None, :]
            + math.cos(heading) * offset[:, None]
        )
        assert np.allclose(picture, height_at(heights, x, y) - state[2], atol=1e-12)


def test_map_beyond_the_border_is_the_borders_height():
    maps = robot_centred_map(ramp(0.2, 0.0), at(x=50.0), 4)
    assert torch.allclose(maps, torch.full((4, 4), 0.2 * 5.0, dtype=torch.float64))


def test_one_terrain_for_each_trajectory(rng):
    heights = torch.from_numpy(rng.normal(size=(3, 60, 70)))
    states = random_states(12).reshape(3, 4, 13)
    together = robot_centred_map(heights, states, 8)
    assert together.shape == (3, 4, 8, 8)
    # not bit for bit: the end of a vector rounds a sine otherwise than its middle
    for i in range(3):
        assert torch.allclose(
            together[i], robot_centred_map(heights[i], states[i], 8), atol=1e-12
        )


def test_map_size_and_resolution():
    fine = robot_centred_map(ramp(0.2, 0.0), at(), 300, size=3.0)
    assert fine.shape == (300, 300)
    assert torch.allclose(
        fine[0, [0, -1]], torch.tensor([-0.299, 0.299], dtype=torch.float64)
    )


def test_numpy_is_taken_too_and_the_wider_type_returned(rng):
    heights, states = rng.normal(size=(50, 50)), random_states(2).float()
    maps = robot_centred_map(heights, states.numpy(), 8)
    assert maps.dtype == torch.float64 and maps.shape == (2, 8, 8)
    assert (
        robot_centred_map(heights.astype(np.float32), states, 8).dtype == torch.float32
    )


@pytest.mark.parametrize(
    ("heights", "states"),
    [
        ((4, 5), (12,)),
        ((2, 9, 9), (13,)),
        ((2, 9, 9), (3, 13)),
        ((9,), (13,)),
        ((4, 5), ()),
    ],
)
def test_wrong_map_shapes_give_both(heights, states):
    with pytest.raises(ValueError) as caught:
        robot_centred_map(torch.zeros(heights), torch.zeros(states), 8)
    assert str(heights) in str(caught.value) and str(states) in str(caught.value)
