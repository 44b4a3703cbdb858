"""Where a result comes from: the versions of the numbers behind it, the code, the libraries and the machine."""

from __future__ import annotations

import datetime
import functools
import hashlib
import importlib.metadata
import platform
import resource
import sys
from pathlib import Path

import companion
import sidm
from companion.numerics import NUMERICS, versions
from sidm.config import config

#: of PyTorch, for a trial; results are compared bit for bit only at the same number
THREADS = 1


@config
class Provenance:
    """What made a row of the store.

    Attributes:
        version: of this package
        source: hash of its files, to find the commit by
        numerics: kind of work -> its version, of all that the result depends on; see
            `companion.numerics`
        python: version, as those of the libraries
        torch: version
        numpy: version
        scipy: version
        device: where it was computed
        threads: of PyTorch
        seconds: of the last stretch, if the trial was interrupted and `resumed`; in a
            bundle its share of them
        resumed: whether it was interrupted and went on
        peak_memory: of the process that ran it, MiB
        date: UTC, ISO 8601
        other_data: 'novice 938fa1f0...': made again elsewhere, alike but for rounding
        bundle: how many trials were trained side by side, at most; 0: alone
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
    other_data: tuple[str, ...] = ()
    bundle: int = 0

    @property
    def stale(self) -> bool:
        """Whether today's code would come to other figures."""
        return any(
            NUMERICS.get(kind) != version for kind, version in self.numerics.items()
        )


@functools.cache
def source() -> str:
    """12 hexadecimal digits for the files of both packages, as they were on disk when this was first called.

    Call it when long work begins: the files may be edited before the work ends.
    """
    digest = hashlib.sha256()
    for package in (sidm, companion):
        folder = Path(str(package.__file__)).parent
        for file in sorted(folder.rglob("*.py")):
            digest.update(
                file.relative_to(folder.parent).as_posix().encode()
                + b"\n"
                + file.read_bytes()
            )
    return digest.hexdigest()[:12]


def peak_memory() -> float:
    """The most memory that this process has held so far, MiB."""
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / (2**20 if sys.platform == "darwin" else 2**10)


def device_name(device: str) -> str:
    """What computed: 'x86_64 CPU', or the name of the GPU."""
    if device == "cpu":
        return f"{platform.machine()} CPU"
    import torch

    return torch.cuda.get_device_name(device) if device.startswith("cuda") else device


def here(
    seconds: float,
    threads: int,
    resumed: bool = False,
    device: str = "cpu",
    bundle: int = 0,
    kind: str = "training",
) -> Provenance:
    """The provenance of a kind of work, one of `numerics.NUMERICS`, that this process has done just now."""
    return Provenance(
        version=sidm.__version__,
        source=source(),
        numerics=versions("bundle" if bundle else kind),
        python=platform.python_version(),
        torch=importlib.metadata.version("torch"),
        numpy=importlib.metadata.version("numpy"),
        scipy=importlib.metadata.version("scipy"),
        device=device_name(device),
        threads=threads,
        seconds=round(seconds, 1),
        resumed=resumed,
        peak_memory=round(peak_memory()),
        date=datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
        bundle=bundle,
    )
