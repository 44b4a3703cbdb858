"""PyBullet, imported when it is first needed, and a connection for each simulator."""

from __future__ import annotations

import functools
import importlib
import os
from typing import Any


@functools.cache
def bullet() -> Any:
    """PyBullet, without the line that it writes to standard error in every process and notebook.

    Raises:
        ImportError: it is not installed; one line.
    """
    screen, nowhere = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 2)
    try:
        return importlib.import_module("pybullet")
    except ImportError as error:
        raise ImportError(
            "simulating needs PyBullet: pip install pybullet (all else works without it)"
        ) from error
    finally:
        os.dup2(screen, 2)
        os.close(screen)
        os.close(nowhere)


class Client:
    """A connection of its own to the simulation: PyBullet's functions with the connection's number filled in."""

    _number: int = -1
    _pybullet: Any = None  # for `close`, where PyBullet is not installed

    def __init__(self) -> None:
        """Start it, without a window."""
        self._pybullet = bullet()
        self._number = self._pybullet.connect(self._pybullet.DIRECT)

    def __getattr__(self, name: str) -> Any:
        """A function or constant of PyBullet."""
        value = getattr(self._pybullet, name)
        return (
            functools.partial(value, physicsClientId=self._number)
            if callable(value)
            else value
        )

    def close(self) -> None:
        """End it; further calls fail. One that nobody holds is ended too, for PyBullet has room for a thousand."""
        # as the interpreter ends, names go
        if self._number >= 0 and self._pybullet.disconnect is not None:
            self._pybullet.disconnect(physicsClientId=self._number)
            self._number = -1

    __del__ = close
