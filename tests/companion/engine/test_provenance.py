"""What made a result: libraries, memory."""

import importlib.metadata
import sys

import pytest

from companion.engine import provenance
from ownrobot import versions


def test_every_library_that_decides_numbers_is_named(monkeypatch):
    made = provenance.record_provenance(1.0, 1)
    for name in ("torch", "numpy", "scipy", "numba", "scikit_learn"):
        assert getattr(made, name) == importlib.metadata.version(name)
    monkeypatch.setattr(versions, "LIBRARIES", ("numpy", "no-such-package"))
    assert versions.library_versions()["no-such-package"] == ""


def test_memory_has_one_unit_on_every_system(monkeypatch):
    """Linux counts KiB, macOS bytes; Windows has no such count."""

    class Resource:
        RUSAGE_SELF = 0

        @staticmethod
        def getrusage(_):
            return type("Usage", (), {"ru_maxrss": 3 * 2**20})

    monkeypatch.setattr(provenance, "resource", Resource)
    monkeypatch.setattr(sys, "platform", "linux")
    assert provenance.peak_memory() == 3 * 2**10
    monkeypatch.setattr(sys, "platform", "darwin")
    assert provenance.peak_memory() == pytest.approx(3.0)
    monkeypatch.setattr(provenance, "resource", None)
    assert provenance.peak_memory() == 0.0
