"""Where a result comes from: the code, the libraries and the machine.

The code is known by two hashes, one a wing: what training and evaluation are made of, and what makes the data. Each is
taken over the modules that the wing's entry points import, as syntax trees without docstrings and comments, so that
rewording a sentence or adding a module beside them leaves a stored result fresh.
"""

from __future__ import annotations

import ast
import datetime
import functools
import hashlib
import importlib.metadata
import platform
import resource
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import sidm
from sidm.config import config

PACKAGE = Path(sidm.__file__).parent

_ALONE = ("sidm.experiments.measure", "sidm.experiments.pretrained")

#: Modules whose work is known by a checksum of what they yield, so that a result does not depend on how they do it.
KNOWN_BY_CHECKSUM = ("sidm.recordings",)

#: The entry points whose code, with all that they import from the wings before, a result depends on.
WINGS = {
    "learning": _ALONE,
    "bundle": (*_ALONE, "sidm.experiments.bundled"),  # the same, many at once
    "least_squares": (*_ALONE, "sidm.experiments.solved"),
    "diagnosis": (*_ALONE, "sidm.experiments.diagnostics", "sidm.experiments.latents"),
    "elsewhere": (*_ALONE, "sidm.experiments.elsewhere", "sidm.experiments.targets"),
    "driving": (
        *_ALONE, "sidm.experiments.driving", "sidm.experiments.drivers", "sidm.experiments.models",
        "sidm.experiments.solved",
    ),  # fmt: skip
    "uncertainty": (*_ALONE, "sidm.experiments.uncertainty", "sidm.experiments.models"),
    "experts": (*_ALONE, "sidm.experiments.experts", "sidm.experiments.family"),
    "simulation": ("sidm.simulation.collect",),
}


@config
class Provenance:
    """What made a row of the store."""

    version: str  # of this package
    learning_source: str  # hash of the code that trains and evaluates, of the trial's wing or a bundle's
    simulation_source: str  # hash of the code that makes the data
    python: str
    torch: str
    numpy: str
    scipy: str
    device: str
    threads: int
    seconds: float  # of the last stretch, if the trial was interrupted and `resumed`; in a bundle its share of them
    resumed: bool
    peak_memory: float  # of the process that ran it, MiB
    date: str  # UTC, ISO 8601
    confirmed_source: str = ""  # hash of later code that would make the same; see `confirm`
    #: 'rerun': it was run again; 'sample': another trial of its kind was; 'inputs': only code changed that reads its
    #: data, by hand where that was found to read the same, bit by bit.
    confirmed_by: str = ""
    other_data: tuple[str, ...] = ()  # 'novice 938fa1f0...': made again elsewhere, alike but for rounding
    bundle: int = 0  # how many trials were trained side by side, at most; 0: alone


def _module_file(name: str) -> Path | None:
    """The file of a module or subpackage of this package, or None."""
    path = PACKAGE.joinpath(*name.split(".")[1:])
    for candidate in (path.with_suffix(".py"), path / "__init__.py"):
        if candidate.is_file():
            return candidate
    return None


def _imports(tree: ast.AST) -> Iterable[str]:
    """Names of this package's modules that a syntax tree may import, at any depth of its functions."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names if alias.name.startswith("sidm."))
        elif isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "sidm":
            yield str(node.module)
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def modules_of(entries: Iterable[str]) -> dict[str, ast.Module]:
    """Name -> syntax tree of the entry points and of every module of this package that they lead to.

    Other modules of `sidm.experiments` are left out: they keep results and do not change them. So are those that are
    KNOWN_BY_CHECKSUM.
    """
    others = ("sidm.experiments", *KNOWN_BY_CHECKSUM)
    found: dict[str, ast.Module] = {}
    waiting = list(entries)
    while waiting:
        name = waiting.pop()
        file = _module_file(name)
        if name not in found and name != "sidm" and file is not None:
            found[name] = ast.parse(file.read_text(encoding="utf-8"))
            waiting += [one for one in _imports(found[name]) if not one.startswith(others)]
    return found


def canonical(node: Any) -> str:
    """A syntax tree as text: no positions, comments, docstrings or empty fields, the same in every Python version."""
    if isinstance(node, list):
        return "[" + ",".join(canonical(item) for item in node) + "]"
    if not isinstance(node, ast.AST):
        return repr(node)
    fields = {name: value for name, value in ast.iter_fields(node) if value not in (None, []) and name != "kind"}
    if isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)) and ast.get_docstring(node):
        fields["body"] = node.body[1:]
    return f"{type(node).__name__}({','.join(f'{name}={canonical(value)}' for name, value in fields.items())})"


@functools.cache
def source_hash(wing: str) -> str:
    """12 hexadecimal digits for the code of a wing, one of WINGS, as it is on disk."""
    digest = hashlib.sha256()
    for name, tree in sorted(modules_of(WINGS[wing]).items()):
        digest.update(f"{name}:{canonical(tree)}\n".encode())
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
    seconds: float, threads: int, resumed: bool, device: str = "cpu", bundle: int = 0, wing: str = "learning"
) -> Provenance:
    """The provenance of something made by this process, just now, with the code of a wing."""
    return Provenance(
        version=sidm.__version__,
        learning_source=source_hash("bundle" if bundle else wing),
        simulation_source=source_hash("simulation"),
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


def is_stale(provenance: Provenance, wing: str = "learning") -> bool:
    """Whether the code of the wing that something was made with has changed since."""
    today = source_hash("bundle" if provenance.bundle else wing)
    known = provenance.learning_source, provenance.confirmed_source
    return today not in known or provenance.simulation_source != source_hash("simulation")
