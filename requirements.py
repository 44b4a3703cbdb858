"""Says what `make setup` will install, or in one line why it cannot be installed.

`make setup` runs this first, with the Python 3 that it is given.
"""

import os
import platform
import shutil
import sys
import sysconfig
import tempfile
from pathlib import Path

HERE = Path(__file__).parent
FILES = ("requirements.txt", "constraints.txt")
OLDEST, NEWEST = (3, 11), (3, 13)  # Python
CPU_BUILD = "https://download.pytorch.org/whl/cpu"
#: GB on the disk of .venv, and for a while in the folder of temporary files
CPU_SIZE, CUDA_SIZE = (3.5, 1.0), (7.0, 4.0)


def refusal(compiler: str) -> str:
    """Why the requirements cannot be installed here; empty when they can.

    Args:
        compiler: the command of the C++ compiler.
    """
    if not OLDEST <= sys.version_info[:2] <= NEWEST:
        supported = "{}.{} to {}.{}".format(*OLDEST, *NEWEST)
        return (
            f"sidm needs Python {supported}, not {platform.python_version()}: "
            "name another one, as in make setup PYTHON=python3.12"
        )
    return _lacking_space() or _lacking_compiler(compiler)


def _lacking_space() -> str:
    """Which disk is too small; empty when none is."""
    cuda = brings_cuda()
    needed: dict[int, float] = {}
    places = HERE, Path(tempfile.gettempdir())
    for place, size in zip(places, CUDA_SIZE if cuda else CPU_SIZE, strict=True):
        device = place.stat().st_dev
        needed[device] = needed.get(device, 0.0) + size
        free = shutil.disk_usage(place).free / 1e9
        if free < needed[device]:
            smaller = f"; {cpu_hint()}" if cuda else ""
            return (
                f"{place} has {free:.1f} GB free, and setting up takes "
                f"{needed[device]:.1f} GB there{smaller}"
            )
    return ""


def _lacking_compiler(compiler: str) -> str:
    """What the compilation of PyBullet lacks; empty when it lacks nothing."""
    if pybullet_has_wheel():
        return ""
    missing = [] if shutil.which(compiler) else [f"a C++ compiler ({compiler})"]
    if not Path(sysconfig.get_path("include"), "Python.h").is_file():
        missing.append("Python's headers (python3-dev)")
    if not missing:
        return ""
    return (
        f"PyBullet has no ready build for Python {platform.python_version()} on "
        f"{sysconfig.get_platform()} and is compiled: install {' and '.join(missing)}, "
        "or take Python 3.11 on 64-bit x86 Linux"
    )


def pybullet_has_wheel() -> bool:
    """Whether PyBullet 3.2.7 has a wheel for this Python."""
    libc, _ = platform.libc_ver()
    machine = sys.implementation.name, sysconfig.get_platform(), libc
    supported = machine == ("cpython", "linux-x86_64", "glibc")
    return sys.version_info[:2] == (3, 11) and supported


def brings_cuda() -> bool:
    """Whether pip will take PyTorch's CUDA build, as it does on Linux by itself."""
    indexes = (os.environ.get(f"PIP_{name}INDEX_URL", "") for name in ("", "EXTRA_"))
    named = any("whl/cpu" in index for index in indexes)
    return sys.platform == "linux" and not named


def cpu_hint() -> str:
    """How to take PyTorch's CPU build."""
    return f"without a GPU, 3 GB less: PIP_EXTRA_INDEX_URL={CPU_BUILD} make setup"


def announcement() -> str:
    """What will be installed, and how long it takes."""
    texts = [(HERE / name).read_text(encoding="utf-8") for name in FILES]
    count = sum("==" in line for text in texts for line in text.splitlines())
    size = "6.3 GB and three to six" if brings_cuda() else "3.3 GB and two to three"
    compiling = "" if pybullet_has_wheel() else ", and ten more to compile PyBullet"
    text = (
        f"setting up .venv with Python {platform.python_version()}: {count} packages, "
        f"{size} minutes{compiling}"
    )
    return f"{text}\n{cpu_hint()}" if brings_cuda() else text


def main() -> int:
    """Print the announcement, or the refusal; 2 when it cannot be installed."""
    compiler = os.environ.get("CXX") or sysconfig.get_config_var("CXX") or "c++"
    reason = refusal(compiler.split()[0])
    file = sys.stderr if reason else sys.stdout
    print(reason or announcement(), file=file, flush=True)
    return 2 if reason else 0


if __name__ == "__main__":
    sys.exit(main())
