"""Says what installing requirements.txt will take with this Python, or in one line why it cannot be done.

`make setup` runs it first, with any Python 3 that it is given.
"""

import os
import platform
import shutil
import sys
import sysconfig
from pathlib import Path

HERE = Path(__file__).parent


def refusal(compiler: str) -> str:
    """What keeps this Python from installing; empty when nothing does."""
    version = platform.python_version()
    if sys.version_info < (3, 11):  # noqa: UP036 - that is the question here
        return f"sidm needs Python 3.11 or later, not {version}: make setup PYTHON=python3.11"
    if pybullet_is_ready():
        return ""
    lacking = [] if shutil.which(compiler) else [f"a C++ compiler ({compiler})"]
    if not Path(sysconfig.get_path("include"), "Python.h").is_file():
        lacking.append("Python's headers (python3-dev)")
    if not lacking:
        return ""
    words = f"PyBullet has no ready build for Python {version} on {sysconfig.get_platform()} and is compiled"
    return f"{words}: install {' and '.join(lacking)}, or take Python 3.11 on 64-bit x86 Linux"


def pybullet_is_ready() -> bool:
    """Whether PyBullet 3.2.7 has a wheel for this Python; of those that sidm runs on, one has."""
    machine = sys.implementation.name, sysconfig.get_platform(), platform.libc_ver()[0]
    return sys.version_info[:2] == (3, 11) and machine == ("cpython", "linux-x86_64", "glibc")


def announcement() -> str:
    """What is coming, and for how long."""
    names = ("requirements.txt", "constraints.txt")
    count = sum("==" in line for name in names for line in (HERE / name).read_text(encoding="utf-8").splitlines())
    words = f"setting up .venv with Python {platform.python_version()}: {count} packages, 2.3 GB (6 GB with CUDA), "
    return words + "one to three minutes" + ("" if pybullet_is_ready() else ", and ten more to compile PyBullet")


def main() -> int:
    """Print one or the other; 2 when it cannot be done."""
    reason = refusal((os.environ.get("CXX") or sysconfig.get_config_var("CXX") or "c++").split()[0])
    print(reason or announcement(), file=sys.stderr if reason else sys.stdout, flush=True)
    return 2 if reason else 0


if __name__ == "__main__":
    sys.exit(main())
