"""What numbers depend on beside their inputs: source files and installed libraries."""

from __future__ import annotations

import contextlib
import functools
import hashlib
import importlib.metadata
from pathlib import Path

#: packages with which numbers are computed
LIBRARIES = ("torch", "numpy", "scipy", "numba", "scikit_learn")


@functools.cache
def source_digest(*folders: Path) -> str:
    """12 hexadecimal digits of the Python files in folders, as at the first call.

    Call it when long work begins: the files may be edited before the work ends.
    """
    digest = hashlib.sha256()
    for folder in folders:
        for file in sorted(folder.rglob("*.py")):
            name = file.relative_to(folder.parent).as_posix()
            digest.update(name.encode() + b"\n" + file.read_bytes())
    return digest.hexdigest()[:12]


def library_versions() -> dict[str, str]:
    """The installed version of each of LIBRARIES; '' if it is not installed."""
    versions = dict.fromkeys(LIBRARIES, "")
    for name in LIBRARIES:
        with contextlib.suppress(importlib.metadata.PackageNotFoundError):
            versions[name] = importlib.metadata.version(name)
    return versions
