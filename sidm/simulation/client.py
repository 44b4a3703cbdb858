"""A Bullet of one's own."""

from __future__ import annotations

from functools import partial
from typing import Any

import pybullet


class Client:
    """A connection to a Bullet of its own: PyBullet's functions with the connection's number filled in."""

    def __init__(self) -> None:
        """Start it, without a window."""
        self._number = pybullet.connect(pybullet.DIRECT)

    def __getattr__(self, name: str) -> Any:
        """A function or constant of PyBullet."""
        value = getattr(pybullet, name)
        return partial(value, physicsClientId=self._number) if callable(value) else value

    def close(self) -> None:
        """End it; further calls fail. One that nobody holds is ended too, for PyBullet has room for a thousand."""
        if self._number >= 0 and pybullet.disconnect is not None:  # as the interpreter ends, names are taken away
            pybullet.disconnect(physicsClientId=self._number)
            self._number = -1

    __del__ = close
