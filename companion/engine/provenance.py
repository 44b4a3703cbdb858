"""Where a result comes from.

The provenance holds versions of the numbers, the code, the libraries and the machine.
"""

from __future__ import annotations

import dataclasses
import datetime
import platform
import sys
from collections.abc import Mapping
from pathlib import Path

import companion
import ownrobot
import sidm
from companion.numerics import RESULT_VERSIONS, versions
from ownrobot.versions import library_versions, source_digest
from sidm.config import config

try:
    import resource
except ImportError:  # Windows
    resource = None  # type: ignore[assignment]

#: PyTorch threads of a trial; the number of threads changes how floats are rounded.
THREADS = 1


@config
class Provenance:
    """How a record was made.

    Attributes:
        version: version of the packages
        source: hash of the files of the packages, to find the commit by
        numerics: kind of work -> its version, for all that the result depends on;
            see `companion.numerics`
        python: version of Python
        torch: version of PyTorch
        numpy: version of NumPy
        scipy: version of SciPy
        numba: version of Numba, whose kernels compute on a CPU; '' without it, and in
            older records
        scikit_learn: version of scikit-learn, as `numba`
        device: processor or GPU that computed it
        threads: number of PyTorch threads
        seconds: run time, s; since the last interruption if it was `resumed`; in a
            bundle the trial's share
        resumed: whether it was interrupted and went on
        peak_memory: most memory of the process that ran it, MiB
        date: UTC, ISO 8601
        digests: name of a dataset -> digest of the motion that was used
        bundle: most trials that were trained side by side; 0: trained alone
    """

    version: str
    source: str
    numerics: dict
    python: str
    torch: str
    numpy: str
    scipy: str
    device: str
    threads: int
    seconds: float
    resumed: bool
    peak_memory: float
    date: str
    digests: dict = dataclasses.field(default_factory=dict)
    bundle: int = 0
    numba: str = ""
    scikit_learn: str = ""

    @property
    def stale(self) -> bool:
        """Whether the current code would give other numbers."""
        return are_stale(self.numerics)


def are_stale(numerics: Mapping[str, int]) -> bool:
    """Whether one of these versions of numbers is not today's."""
    return any(
        RESULT_VERSIONS.get(kind) != version for kind, version in numerics.items()
    )


def source() -> str:
    """Hash of the files of the packages, 12 hexadecimal digits.

    It is of the files as they were at the first call.
    """
    packages = (sidm, ownrobot, companion)
    return source_digest(*(Path(str(package.__file__)).parent for package in packages))


def peak_memory() -> float:
    """The most memory that this process has held so far, MiB; 0 on Windows."""
    if resource is None:
        return 0.0
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / (2**20 if sys.platform == "darwin" else 2**10)


def device_name(device: str) -> str:
    """The name of a device: 'x86_64 CPU', or that of the GPU."""
    if device == "cpu":
        return f"{platform.machine()} CPU"
    import torch

    return torch.cuda.get_device_name(device) if device.startswith("cuda") else device


def record_provenance(
    seconds: float,
    threads: int,
    resumed: bool = False,
    device: str = "cpu",
    bundle: int = 0,
    kind: str = "training",
    digests: Mapping[str, str] | None = None,
) -> Provenance:
    """The provenance of work that this process has just done."""
    return Provenance(
        version=sidm.__version__,
        source=source(),
        numerics=versions("bundle" if bundle else kind),
        python=platform.python_version(),
        **library_versions(),  # type: ignore[arg-type]
        device=device_name(device),
        threads=threads,
        seconds=round(seconds, 1),
        resumed=resumed,
        peak_memory=round(peak_memory()),
        date=datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
        bundle=bundle,
        digests=dict(digests or {}),
    )
