"""Run the numerical tests and the notebooks with the rounding of other processors.

`make portable` runs this script. Libraries choose their kernels by the instructions of
the processor, and with the kernels the order of sums, fused products and the
polynomials of exp and sin. Environment variables take instructions away from the
libraries; a leg is the tests under one set of variables.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import torch

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
    "companion/extensions",
]
#: what makes pytest run the notebooks, and compare the outputs that they mark
NOTEBOOKS = ["--nbval-lax", "--nbval-current-env", "notebooks"]
NOTEBOOKS += ["--nbval-kernel-startup-timeout=600"]
#: levels of x86 processors, as PyTorch calls them; the lowest has SSE
LEVELS = ["DEFAULT", "AVX2", "AVX512"]
#: Leg -> the level that it leaves, and variables that libraries read when they are
#: loaded: PyTorch, oneDNN, MKL, OpenBLAS, NumPy, libm, Numba. NumPy's are beginnings of
#: the names of its features; libm's names are those of older and of newer versions.
LEGS: dict[str, tuple[str | None, dict[str, str]]] = {
    "avx2": (
        "AVX2",
        {
            "ATEN_CPU_CAPABILITY": "avx2",
            "ONEDNN_MAX_CPU_ISA": "AVX2",
            "MKL_CBWR": "AVX2",
            "OPENBLAS_CORETYPE": "Haswell",
            "NPY_DISABLE_CPU_FEATURES": "X86_V4 AVX512",
        },
    ),
    "sse": (
        "DEFAULT",
        {
            "ATEN_CPU_CAPABILITY": "default",
            "ONEDNN_MAX_CPU_ISA": "SSE41",
            "MKL_CBWR": "COMPATIBLE",
            "OPENBLAS_CORETYPE": "Nehalem",
            "NPY_DISABLE_CPU_FEATURES": "X86 AVX F16C FMA",
            "GLIBC_TUNABLES": (
                "glibc.cpu.hwcaps=-AVX2,-FMA,-FMA4,-AVX2_Usable,-FMA_Usable"
            ),
            "NUMBA_CPU_NAME": "generic",
        },
    ),
    "two-threads": (None, {"OMP_NUM_THREADS": "2"}),
}


def environment(settings: dict[str, str]) -> dict[str, str]:
    """Environment of this process with other settings of the libraries.

    Waiting threads leave their core.
    """
    lowered = dict(settings)
    if starts := tuple(lowered.pop("NPY_DISABLE_CPU_FEATURES", "").split()):
        there = np.show_config(mode="dicts")["SIMD Extensions"].get("found", [])
        features = [name for name in there if name.startswith(starts)]
        lowered["NPY_DISABLE_CPU_FEATURES"] = ",".join(features)
    passive = {"OMP_NUM_THREADS": "1", "OMP_WAIT_POLICY": "passive"}
    return os.environ | passive | lowered


def passes(leg: str, paths: list[str], jobs: str) -> bool:
    """Whether the tests of some paths, and the notebooks, pass on a leg."""
    variables = environment(LEGS[leg][1])
    pytest = [sys.executable, "-m", "pytest", "-n", jobs, "--dist", "loadfile"]
    pytest += ["--threads", variables["OMP_NUM_THREADS"]]
    paths = [f"tests/{path}" for path in paths]
    return not subprocess.call([*pytest, *paths, *NOTEBOOKS], cwd=ROOT, env=variables)


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
    options = parser.parse_args()
    if unknown := set(options.legs) - set(LEGS):
        parser.error(f"no leg {', '.join(unknown)}; there are {', '.join(LEGS)}")
    paths = CORE if options.core else [*CORE, "companion"]
    here = torch.backends.cpu.get_cpu_capability()
    lower = LEVELS[: LEVELS.index(here)] if here in LEVELS else []
    ends = {}
    for leg in options.legs or LEGS:
        leaves, _ = LEGS[leg]
        if leaves in (None, *lower):
            print(f"{leg}, on a processor with {here}:", flush=True)
            ends[leg] = passes(leg, paths, options.jobs)
        else:
            print(f"{leg}: left out, this processor has nothing above {leaves}")
    print(
        f"passed: {', '.join(leg for leg, end in ends.items() if end) or 'none'}; "
        f"failed: {', '.join(leg for leg, end in ends.items() if not end) or 'none'}"
    )
    return 0 if ends and all(ends.values()) else 1


if __name__ == "__main__":
    sys.exit(main())
