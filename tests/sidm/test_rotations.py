"""Quaternions against SciPy and against their laws."""

import math

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from sidm import rotations as R

number = st.floats(-1, 1)
quaternions = (
    st.lists(number, min_size=4, max_size=4)
    .filter(lambda q: sum(c * c for c in q) > 1e-2)
    .map(lambda q: R.normalise(torch.tensor(q, dtype=torch.float64)))
)
vectors = st.lists(st.floats(-10, 10), min_size=3, max_size=3).map(
    lambda v: torch.tensor(v, dtype=torch.float64)
)


@pytest.fixture
def several(rng):
    """Quaternions (50, 4) and vectors (50, 3)."""
    return torch.from_numpy(
        Rotation.random(50, random_state=0).as_quat()
    ), torch.from_numpy(rng.normal(size=(50, 3)))


def same_rotation(p, q):
    assert torch.allclose(R.canonical(p), R.canonical(q), atol=1e-12) or torch.allclose(
        p, -q, atol=1e-12
    )


def test_rotate_is_scipys(several):
    q, v = several
    assert np.allclose(R.rotate(q, v), Rotation.from_quat(q.numpy()).apply(v.numpy()))
    assert np.allclose(
        R.rotate_inverse(q, v), Rotation.from_quat(q.numpy()).inv().apply(v.numpy())
    )


def test_multiply_is_scipys(several):
    q, _ = several
    p = q.flip(0)
    expected = (Rotation.from_quat(p.numpy()) * Rotation.from_quat(q.numpy())).as_quat()
    assert np.allclose(
        R.canonical(R.multiply(p, q)), R.canonical(torch.from_numpy(expected))
    )


def test_yaw_is_scipys(several):
    q, _ = several
    assert np.allclose(R.yaw(q), Rotation.from_quat(q.numpy()).as_euler("ZYX")[:, 0])


def test_quarter_turn_to_the_left():
    q = R.from_yaw(torch.tensor(math.pi / 2, dtype=torch.float64))
    assert torch.allclose(
        q, torch.tensor([0, 0, math.sqrt(0.5), math.sqrt(0.5)], dtype=torch.float64)
    )
    assert torch.allclose(
        R.rotate(q, q.new_tensor([1.0, 0, 0])), q.new_tensor([0.0, 1, 0])
    )


def test_identity_and_zero():
    identity = torch.tensor([0.0, 0, 0, 1])
    assert torch.equal(R.normalise(torch.zeros(4)), identity)
    assert torch.equal(R.multiply(identity, identity), identity)
    assert torch.equal(
        R.rotate(identity, torch.tensor([1.0, 2, 3])), torch.tensor([1.0, 2, 3])
    )


def test_leading_dimensions_broadcast(several):
    q, v = several
    assert R.rotate(q[:5, None], v[:7]).shape == (5, 7, 3)
    assert R.multiply(q[:5, None], q[:7]).shape == (5, 7, 4)
    assert torch.allclose(R.rotate(q[:5, None], v[:7])[3, 2], R.rotate(q[3], v[2]))
    assert R.rotate(q[0], v).shape == (50, 3)


def test_types_are_kept():
    assert R.multiply(torch.rand(3, 4), torch.rand(3, 4)).dtype == torch.float32
    assert R.from_yaw(torch.zeros(3, dtype=torch.float64)).dtype == torch.float64


@given(quaternions, quaternions, vectors)
def test_a_product_turns_by_its_factors(p, q, v):
    assert torch.allclose(
        R.rotate(R.multiply(p, q), v), R.rotate(p, R.rotate(q, v)), atol=1e-9
    )


@given(quaternions, vectors)
def test_inverse_brings_back(q, v):
    assert torch.allclose(R.rotate_inverse(q, R.rotate(q, v)), v, atol=1e-9)
    same_rotation(R.multiply(q, R.conjugate(q)), q.new_tensor([0.0, 0, 0, 1]))


@given(quaternions, vectors)
def test_lengths_are_kept(q, v):
    assert torch.allclose(R.rotate(q, v).norm(), v.norm(), atol=1e-9)
    assert torch.allclose(R.multiply(q, q).norm(), q.new_tensor(1.0))


@given(quaternions, vectors)
def test_canonical_is_the_same_rotation(q, v):
    assert R.canonical(q)[3] >= 0
    assert torch.equal(R.canonical(q), R.canonical(R.canonical(q)))
    assert torch.allclose(R.rotate(R.canonical(q), v), R.rotate(q, v), atol=1e-9)


@given(st.floats(-20, 20))
def test_yaw_of_from_yaw(angle):
    angle = torch.tensor(angle, dtype=torch.float64)
    difference = R.wrap(R.yaw(R.from_yaw(angle)) - angle)
    assert abs(float(difference)) < 1e-9
    assert abs(float(R.wrap(angle))) <= math.pi + 1e-12  # rounding of atan2
