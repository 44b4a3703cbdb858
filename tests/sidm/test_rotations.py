"""Quaternions against SciPy and against their laws."""

import math

import numpy as np
import torch
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from sidm import rotations as R

quaternions = (
    st.lists(st.floats(-1, 1), min_size=4, max_size=4)
    .filter(lambda q: sum(c * c for c in q) > 1e-2)
    .map(lambda q: R.normalise(torch.tensor(q, dtype=torch.float64)))
)
vectors = st.lists(st.floats(-10, 10), min_size=3, max_size=3).map(
    lambda v: torch.tensor(v, dtype=torch.float64)
)


def test_turns_products_and_headings_are_scipys(rng):
    theirs = Rotation.random(50, random_state=0)
    q = torch.from_numpy(theirs.as_quat())
    p, v = q.flip(0), torch.from_numpy(rng.normal(size=(50, 3)))
    assert np.allclose(R.rotate(q, v), theirs.apply(v.numpy()))
    assert np.allclose(R.rotate_inverse(q, v), theirs.inv().apply(v.numpy()))
    product = Rotation.from_quat(p.numpy()) * theirs
    assert np.allclose(R.canonical(R.multiply(p, q)), product.as_quat(canonical=True))
    assert np.allclose(R.yaw(q), theirs.as_euler("ZYX")[:, 0])
    assert R.multiply(q[:5, None], q[:7]).shape == (5, 7, 4)
    assert torch.allclose(R.rotate(q[:5, None], v[:7])[3, 2], R.rotate(q[3], v[2]))
    assert R.normalise(torch.zeros(4)).tolist() == [0, 0, 0, 1]  # no rotation


@given(quaternions, quaternions, vectors)
def test_a_product_turns_by_its_factors_and_its_inverse_brings_back(p, q, v):
    turned = R.rotate(R.multiply(p, q), v)
    assert torch.allclose(turned, R.rotate(p, R.rotate(q, v)), atol=1e-9)
    assert torch.allclose(R.rotate_inverse(R.multiply(p, q), turned), v, atol=1e-9)
    assert torch.allclose(turned.norm(), v.norm(), atol=1e-9)


@given(quaternions, vectors)
def test_canonical_is_the_same_rotation(q, v):
    assert R.canonical(q)[3] >= 0
    assert torch.allclose(R.rotate(R.canonical(q), v), R.rotate(q, v), atol=1e-9)


@given(st.floats(-20, 20))
def test_yaw_of_from_yaw(angle):
    angle = torch.tensor(angle, dtype=torch.float64)
    difference = R.wrap(R.yaw(R.from_yaw(angle)) - angle)
    assert abs(float(difference)) < 1e-9
    assert abs(float(R.wrap(angle))) <= math.pi + 1e-12  # rounding of atan2
