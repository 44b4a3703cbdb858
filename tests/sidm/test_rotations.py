"""Quaternions against SciPy."""

import math

import numpy as np
import torch
from scipy.spatial.transform import Rotation

from sidm import rotations as R


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
    assert torch.allclose(R.normalise(5 * q), q)
    assert R.normalise(torch.zeros(4)).tolist() == [0, 0, 0, 1]  # no rotation


def test_headings_are_wrapped_and_come_back(rng):
    angle = torch.from_numpy(rng.uniform(-20, 20, 50))
    theirs = Rotation.from_euler("z", angle[:, None].numpy())
    assert np.allclose(
        R.rotate(R.from_yaw(angle), torch.ones(3).double()), theirs.apply([1, 1, 1])
    )
    assert torch.allclose(R.yaw(R.from_yaw(angle)), R.wrap(angle))
    assert torch.allclose(torch.cos(R.wrap(angle)), torch.cos(angle))
    assert R.wrap(angle).abs().max() <= math.pi + 1e-12  # rounding of atan2
    ahead = torch.tensor([1.0, 0.0]).double()
    assert np.allclose(R.turn(ahead, angle), theirs.apply([1, 0, 0])[:, :2])
