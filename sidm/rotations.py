"""Quaternions and headings as pure functions on tensors.

A quaternion is (..., 4), unit length, in the order x, y, z, w, and turns vectors of the
body frame into the world frame. Vectors are (..., 3). Leading dimensions broadcast;
results have the inputs' type and device.
"""

from __future__ import annotations

import torch
from torch import Tensor


def multiply(p: Tensor, q: Tensor) -> Tensor:
    """Hamilton product (..., 4) of `p` and `q`, each (..., 4): first turn by `q`, then by `p`."""
    u, a, v, b = p[..., :3], p[..., 3:], q[..., :3], q[..., 3:]
    vector = a * v + b * u + _cross(u, v)
    scalar = a * b - (u * v).sum(-1, keepdim=True)
    return torch.cat([vector, scalar], dim=-1)


def conjugate(q: Tensor) -> Tensor:
    """The opposite rotation (..., 4) of unit quaternions (..., 4)."""
    return torch.cat([-q[..., :3], q[..., 3:]], dim=-1)


def normalise(q: Tensor) -> Tensor:
    """`q` (..., 4) at unit length; the zero quaternion, which is no rotation at all, becomes the identity."""
    length = q.norm(dim=-1, keepdim=True)
    identity = torch.tensor([0.0, 0.0, 0.0, 1.0], dtype=q.dtype, device=q.device)
    return torch.where(
        length > 0, q / length.clamp_min(torch.finfo(q.dtype).tiny), identity
    )


def canonical(q: Tensor) -> Tensor:
    """The one of `q` and -`q` (..., 4), the same rotation, that has w >= 0."""
    return torch.where(q[..., 3:] < 0, -q, q)


def rotate(q: Tensor, v: Tensor) -> Tensor:
    """Vectors `v` (..., 3) of the body frame in the world frame, for unit quaternions `q` (..., 4)."""
    u, w = q[..., :3], q[..., 3:]
    t = 2 * _cross(u, v)
    return v + w * t + _cross(u, t)


def rotate_inverse(q: Tensor, v: Tensor) -> Tensor:
    """Vectors `v` (..., 3) of the world frame in the body frame, for unit quaternions `q` (..., 4)."""
    return rotate(conjugate(q), v)


def yaw(q: Tensor) -> Tensor:
    """Heading (...), rad in (-pi, pi], of quaternions (..., 4): the direction of the body's x axis seen from above."""
    x, y, z, w = q.unbind(-1)
    return torch.atan2(2 * (w * z + x * y), w * w + x * x - y * y - z * z)


def from_yaw(angle: Tensor) -> Tensor:
    """Quaternions (..., 4) of turns by `angle` (...), rad, about the vertical."""
    zero = torch.zeros_like(angle)
    return torch.stack([zero, zero, torch.sin(angle / 2), torch.cos(angle / 2)], dim=-1)


def wrap(angle: Tensor) -> Tensor:
    """`angle` (...), rad, brought into [-pi, pi]."""
    return torch.atan2(torch.sin(angle), torch.cos(angle))


def turn(v: Tensor, angle: Tensor) -> Tensor:
    """Vectors `v` (..., 2) of the plane, turned to the left by `angle` (...), rad."""
    cos, sin = torch.cos(angle), torch.sin(angle)
    return torch.stack(
        [cos * v[..., 0] - sin * v[..., 1], sin * v[..., 0] + cos * v[..., 1]], dim=-1
    )


def _cross(u: Tensor, v: Tensor) -> Tensor:
    """Vector product (..., 3), broadcasting."""
    return torch.linalg.cross(*torch.broadcast_tensors(u, v))
