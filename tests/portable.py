"""Run the numerical tests with the rounding of other processors.

`make portable` runs this script. Libraries choose their kernels by the instructions of
the processor, and with the kernels the order of sums, fused products and the
polynomials of exp and sin. Environment variables take instructions away from the
libraries. Before a leg, the tests under one set of variables, each of its variables
alone must change what its library computes: a leg that changes nothing could not fail.
"""

from __future__ import annotations

import argparse
import functools
import json
import math
import os
import platform
import subprocess
import sys
from hashlib import sha256
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

ROOT = Path(__file__).parents[1]
CORE = [
    "sidm/learning",
    "sidm/simulation",
    "ownrobot/recordings",
    "sidm/test_rotations.py",
    "sidm/test_terrain.py",
    "sidm/test_shards.py",
    "ownrobot/methods",
    "companion/bundle",
    "companion/beyond",
]
#: levels of x86 processors, as PyTorch calls them; the lowest has SSE
LEVELS = ["DEFAULT", "AVX2", "AVX512"]


VARIABLES = {
    "ATEN_CPU_CAPABILITY": "PyTorch",
    "ONEDNN_MAX_CPU_ISA": "oneDNN",
    "MKL_CBWR": "MKL",
    "OPENBLAS_CORETYPE": "OpenBLAS",
    "NPY_DISABLE_CPU_FEATURES": "NumPy",
    "GLIBC_TUNABLES": "libm",
    "NUMBA_CPU_NAME": "Numba",
    "OMP_NUM_THREADS": "OpenMP",
}


class Leg(NamedTuple):
    """Variables that libraries read when they are loaded, to simulate a processor."""

    #: level that is left to the libraries; None if instructions stay the same
    leaves: str | None
    settings: dict[str, str]


LEGS = {
    "avx2": Leg(
        "AVX2",
        {
            "ATEN_CPU_CAPABILITY": "avx2",
            "ONEDNN_MAX_CPU_ISA": "AVX2",
            "MKL_CBWR": "AVX2",
            "OPENBLAS_CORETYPE": "Haswell",
            # beginnings of the names of NumPy's features
            "NPY_DISABLE_CPU_FEATURES": "X86_V4 AVX512",
        },
    ),
    "sse": Leg(
        "DEFAULT",
        {
            "ATEN_CPU_CAPABILITY": "default",
            "ONEDNN_MAX_CPU_ISA": "SSE41",
            "MKL_CBWR": "COMPATIBLE",
            "OPENBLAS_CORETYPE": "Nehalem",
            "NPY_DISABLE_CPU_FEATURES": "X86 AVX F16C FMA",
            # names of older and of newer versions
            "GLIBC_TUNABLES": (
                "glibc.cpu.hwcaps=-AVX2,-FMA,-FMA4,-AVX2_Usable,-FMA_Usable"
            ),
            "NUMBA_CPU_NAME": "generic",
        },
    ),
    "two-threads": Leg(None, {"OMP_NUM_THREADS": "2"}),
}


def numbers(*shape: int) -> np.ndarray:
    """Numbers between -1 and 1 that are the same on every processor.

    They come from whole numbers by operations that IEEE 754 rounds.
    """
    return 2 * np.random.default_rng(0).random(shape) - 1


def computed(library: str) -> dict[str, Any]:
    """Results of a library, some by instructions that not every processor has."""
    import torch

    x, pair = numbers(10_000), numbers(2, 200, 200)
    a, b = pair
    y, z, (c, d) = (
        torch.from_numpy(numbers(100, 100)),
        torch.from_numpy(numbers(100_003)),
        torch.from_numpy(pair),
    )
    products = {"product": a @ b, "float32 product": a.astype("f4") @ b.astype("f4")}
    return {
        "NumPy": lambda: (
            {f.__name__: f(x) for f in (np.exp, np.arctan, np.tanh)}
            | {
                f"{f.__name__} of float32": f(x.astype(np.float32))
                for f in (np.exp, np.sin)
            }
        ),
        "libm": lambda: {
            f.__name__: [f(number) for number in 9 * x]
            for f in (math.sin, math.cos, math.exp)
        },
        "OpenBLAS": lambda: products | {"solve": np.linalg.solve(a, b)},
        "PyTorch": lambda: (
            {f.__name__: f(y) for f in (torch.sigmoid, torch.log1p)}
            | {"log_softmax": y.log_softmax(1), "atan2": torch.atan2(y, y.T)}
        ),
        "oneDNN": networks,
        "MKL": lambda: {
            "product": c @ d,
            "float32 product": c.float() @ d.float(),
            "qr": torch.linalg.qr(c)[0],
        },
        "Numba": compiled,
        "OpenMP": lambda: {
            "sum": z.sum(),
            "float32 sum": z.float().sum(),
            "sum of squares": z.square().sum(),
        },
    }[library]()


def networks() -> dict[str, Any]:
    """Convolutions and an LSTM, as oneDNN computes them."""
    import torch

    sizes = (16, 16, 20, 20), (8, 16, 4, 4), (8,)
    maps, kernels, biases = (torch.from_numpy(numbers(*size)).float() for size in sizes)
    lstm = torch.nn.LSTM(16, 32)
    with torch.no_grad():
        for weights in lstm.parameters():
            weights.copy_(torch.from_numpy(numbers(*weights.shape)))
    learnt = lstm(maps[0, :, :16, :16])[0]
    learnt.sum().backward()
    return {
        "convolution": torch.conv2d(maps, kernels, biases),
        "convolution of one channel": torch.conv2d(maps[:, :1], kernels[:, :1], biases),
        "LSTM": learnt.detach(),
        "LSTM's gradient": lstm.weight_hh_l0.grad,
    }


def compiled() -> dict[str, Any]:
    """The encoder's convolutions and their gradients, as Numba compiles them."""
    import torch

    from sidm.learning import Network
    from sidm.learning.convolution import features
    from sidm.learning.networks import Encoder

    torch.set_num_threads(1)
    torch.manual_seed(0)
    layers = Encoder(Network(pixels=12)).convolutions
    maps, beside = torch.from_numpy(numbers(20, 12, 12)).float(), torch.zeros(20, 1)
    outputs = features(layers, maps, beside)
    outputs.sum().backward()
    return {"features": outputs.detach(), "gradient": layers[0].weight.grad}


def digests(library: str) -> dict[str, str]:
    """Digests of a library's results, which show every bit."""
    return {
        name: sha256(np.asarray(values).tobytes()).hexdigest()
        for name, values in computed(library).items()
    }


def processor() -> dict[str, Any]:
    """Level of this processor, its features for NumPy, and the libraries in use."""
    import torch

    config = np.show_config(mode="dicts")
    there = {
        "oneDNN": torch.backends.mkldnn.is_available(),
        "MKL": torch.backends.mkl.is_available(),
        "OpenBLAS": "openblas" in config["Build Dependencies"]["blas"]["name"],
        "libm": platform.libc_ver()[0] == "glibc",
    }
    return {
        "level": torch.backends.cpu.get_cpu_capability(),
        "features": config["SIMD Extensions"].get("found", []),
        "libraries": [
            library for library in VARIABLES.values() if there.get(library, True)
        ],
    }


def environment(settings: dict[str, str]) -> dict[str, str]:
    """Environment of this process with other settings of the libraries.

    Waiting threads leave their core.
    """
    plain = {name: value for name, value in os.environ.items() if name not in VARIABLES}
    return plain | {"OMP_NUM_THREADS": "1", "OMP_WAIT_POLICY": "passive"} | settings


def ask(question: str, settings: dict[str, str]) -> Any:
    """Answer of a new process under some settings.

    The question is 'processor' or the name of a library.
    """
    arguments = [sys.executable, "-m", "tests.portable", "--ask", question]
    return json.loads(
        subprocess.check_output(
            arguments, env=environment(settings), cwd=ROOT, text=True
        )
    )


@functools.cache
def as_it_is(library: str) -> dict[str, str]:
    """Digests of a library with all instructions of this processor."""
    return ask(library, {})


class Blunt(Exception):
    """A setting changes nothing, although it should."""


def seen(leg: Leg, here: dict[str, Any]) -> dict[str, str]:
    """Settings of a leg that lower something here; each alone must change results.

    Prints what each setting changes.

    Raises Blunt if a setting changes nothing.
    """
    kept = {}
    lower = LEVELS[: LEVELS.index(here["level"])] if here["level"] in LEVELS else []
    for name, value in leg.settings.items():
        if (library := VARIABLES[name]) == "NumPy":
            starts = tuple(value.split())
            value = ",".join(
                name for name in here["features"] if name.startswith(starts)
            )
        if library not in here["libraries"]:
            print(f"  {name}: left out, {library} is not in use here")
        elif leg.leaves not in (None, *lower):
            print(f"  {name}: left out, this processor has nothing above {leg.leaves}")
        else:
            before, after = as_it_is(library), ask(library, {name: value})
            changed = [key for key in before if after[key] != before[key]]
            if not changed:
                raise Blunt(
                    f"{name}={value} changes none of {library}'s {', '.join(before)}: "
                    "the leg could not fail"
                )
            print(
                f"  {name}={value} changes {library}'s {', '.join(changed)}", flush=True
            )
            kept[name] = value
    return kept


def tested(paths: list[str], settings: dict[str, str], jobs: str) -> bool:
    """Whether the tests of some paths pass under these settings."""
    variables = environment(settings)
    pytest = [sys.executable, "-m", "pytest", "-n", jobs, "--dist", "loadfile"]
    pytest += ["--threads", variables["OMP_NUM_THREADS"]]
    paths = [f"tests/{path}" for path in paths]
    return not subprocess.call([*pytest, *paths], cwd=ROOT, env=variables)


def main() -> int:
    """Run the chosen legs; return 0 if all that this processor can show passed.

    At least one leg must have passed.
    """
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument(
        "legs", nargs="*", metavar="LEG", help=f"of {', '.join(LEGS)}; all by default"
    )
    parser.add_argument(
        "--core",
        action="store_true",
        help="without the rest of tests/companion, which takes most of the time",
    )
    parser.add_argument("--jobs", default="2", help="processes side by side")
    parser.add_argument("--ask", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.ask:
        asked = options.ask
        print(json.dumps(processor() if asked == "processor" else digests(asked)))
        return 0
    if unknown := set(options.legs) - set(LEGS):
        parser.error(f"no leg {', '.join(unknown)}; there are {', '.join(LEGS)}")
    paths = CORE if options.core else [*CORE, "companion"]
    here, ends = ask("processor", {}), {}
    for leg in options.legs or LEGS:
        print(f"{leg}, on a processor with {here['level']}:", flush=True)
        try:
            if settings := seen(LEGS[leg], here):
                ends[leg] = tested(paths, settings, options.jobs)
        except Blunt as error:
            print(f"  {error}")
            ends[leg] = False
    print(
        f"passed: {', '.join(leg for leg, end in ends.items() if end) or 'none'}; "
        f"failed: {', '.join(leg for leg, end in ends.items() if not end) or 'none'}"
    )
    return 0 if ends and all(ends.values()) else 1


if __name__ == "__main__":
    sys.exit(main())
