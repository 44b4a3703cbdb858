"""Quaternions and headings as pure functions on tensors.

A quaternion is (..., 4), unit length, in the order x, y, z, w, and turns vectors of the
body frame into the world frame. Vectors are (..., 3). Leading dimensions broadcast;
results have the inputs' type and device.
"""

from __future__ import annotations

import torch
from torch import Tensor


def multiply(p: Tensor, q: Tensor) -> Tensor:
    """Hamilton product (..., 4) of `p` and `q`, each (..., 4); `q` turns first."""
    u, a, v, b = p[..., :3], p[..., 3:], q[..., :3], q[..., 3:]
    vector = a * v + b * u + _cross(u, v)
    scalar = a * b - (u * v).sum(-1, keepdim=True)
    return torch.cat([vector, scalar], dim=-1)


def conjugate(q: Tensor) -> Tensor:
    """Quaternions (..., 4) of the opposite rotations of unit quaternions (..., 4)."""
    return torch.cat([-q[..., :3], q[..., 3:]], dim=-1)


def normalise(q: Tensor) -> Tensor:
    """Quaternions `q` (..., 4) of unit length; zero becomes the identity."""
    length = q.norm(dim=-1, keepdim=True)
    identity = torch.tensor([0.0, 0.0, 0.0, 1.0], dtype=q.dtype, device=q.device)
    unit = q / length.clamp_min(torch.finfo(q.dtype).tiny)
    return torch.where(length > 0, unit, identity)


def canonical(q: Tensor) -> Tensor:
    """The quaternion `q` or `-q` (..., 4), whichever has w >= 0: the same rotation."""
    return torch.where(q[..., 3:] < 0, -q, q)


def rotate(q: Tensor, v: Tensor) -> Tensor:
    """Vectors `v` (..., 3) turned from body to world frame by unit quaternions `q`."""
    u, w = q[..., :3], q[..., 3:]
    t = 2 * _cross(u, v)
    return v + w * t + _cross(u, t)


def rotate_inverse(q: Tensor, v: Tensor) -> Tensor:
    """Vectors `v` (..., 3) turned from world to body frame by unit quaternions `q`."""
    return rotate(conjugate(q), v)


def yaw(q: Tensor) -> Tensor:
    """Headings (...), rad in (-pi, pi], of the x axes of quaternions `q` (..., 4)."""
    x, y, z, w = q.unbind(-1)
    return torch.atan2(2 * (w * z + x * y), w * w + x * x - y * y - z * z)


def from_yaw(angle: Tensor) -> Tensor:
    """Quaternions (..., 4) of turns by `angle` (...), rad, about the vertical."""
    zero = torch.zeros_like(angle)
    return torch.stack([zero, zero, torch.sin(angle / 2), torch.cos(angle / 2)], dim=-1)


def wrap(angle: Tensor) -> Tensor:
    """Angles (...), rad, brought into [-pi, pi]."""
    return torch.atan2(torch.sin(angle), torch.cos(angle))


def turn(v: Tensor, angle: Tensor) -> Tensor:
    """Vectors `v` (..., 2) of the plane, turned to the left by `angle` (...), rad."""
    cos, sin = torch.cos(angle), torch.sin(angle)
    x, y = v[..., 0], v[..., 1]
    return torch.stack([cos * x - sin * y, sin * x + cos * y], dim=-1)


def _cross(u: Tensor, v: Tensor) -> Tensor:
    """Vector product (..., 3); leading dimensions broadcast."""
    return torch.linalg.cross(*torch.broadcast_tensors(u, v))
