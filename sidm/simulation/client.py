"""PyBullet, imported when it is first needed, and a connection for each simulator."""

from __future__ import annotations

import functools
import importlib
import os
from typing import Any


@functools.cache
def bullet() -> Any:
    """The module PyBullet, imported without the line that it prints to stderr."""
    try:
        stderr, null = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    except OSError:  # without stderr there is no line to hide
        stderr = null = -1
    if null >= 0:
        os.dup2(null, 2)
    try:
        return importlib.import_module("pybullet")
    except ImportError as error:
        raise ImportError(
            "simulating needs PyBullet: pip install pybullet "
            "(all else works without it)"
        ) from error
    finally:
        if null >= 0:
            os.dup2(stderr, 2)
            os.close(stderr)
            os.close(null)


class Client:
    """PyBullet's functions with the number of a connection of its own filled in."""

    _number: int = -1
    _pybullet: Any = None  # for `close`, where PyBullet is not installed

    def __init__(self) -> None:
        self._pybullet = bullet()
        self._number = self._pybullet.connect(self._pybullet.DIRECT)

    def __getattr__(self, name: str) -> Any:
        """A function or constant of PyBullet."""
        value = getattr(self._pybullet, name)
        if not callable(value):
            return value
        return functools.partial(value, physicsClientId=self._number)

    def close(self) -> None:
        """Close the connection; further calls fail.

        A client that nothing refers to is closed too: PyBullet has room for about a
        thousand connections.
        """
        # at the interpreter's end PyBullet's functions may be gone already
        if self._number >= 0 and self._pybullet.disconnect is not None:
            self._pybullet.disconnect(physicsClientId=self._number)
            self._number = -1

    __del__ = close
