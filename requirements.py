"""Says what `make setup` will install, or in one line why it cannot be installed.

`make setup` runs this first, with the Python 3 that it is given.
"""

import os
import platform
import shutil
import sys
import sysconfig
from pathlib import Path

HERE = Path(__file__).parent
FILES = ("requirements.txt", "constraints.txt")


def refusal(compiler: str) -> str:
    """Why this Python cannot install the requirements; empty when it can.

    Args:
        compiler: the command of the C++ compiler.
    """
    version = platform.python_version()
    if sys.version_info < (3, 11):  # noqa: UP036 - the question here
        return (
            f"sidm needs Python 3.11 or later, not {version}: "
            "make setup PYTHON=python3.11"
        )
    if pybullet_has_wheel():
        return ""
    missing = [] if shutil.which(compiler) else [f"a C++ compiler ({compiler})"]
    if not Path(sysconfig.get_path("include"), "Python.h").is_file():
        missing.append("Python's headers (python3-dev)")
    if not missing:
        return ""
    return (
        f"PyBullet has no ready build for Python {version} on "
        f"{sysconfig.get_platform()} and is compiled: install {' and '.join(missing)}, "
        "or take Python 3.11 on 64-bit x86 Linux"
    )


def pybullet_has_wheel() -> bool:
    """Whether PyBullet 3.2.7 has a wheel for this Python."""
    libc, _ = platform.libc_ver()
    machine = sys.implementation.name, sysconfig.get_platform(), libc
    supported = machine == ("cpython", "linux-x86_64", "glibc")
    return sys.version_info[:2] == (3, 11) and supported


def announcement() -> str:
    """What will be installed, and how long it takes."""
    texts = [(HERE / name).read_text(encoding="utf-8") for name in FILES]
    count = sum("==" in line for text in texts for line in text.splitlines())
    compiling = "" if pybullet_has_wheel() else ", and ten more to compile PyBullet"
    return (
        f"setting up .venv with Python {platform.python_version()}: {count} packages, "
        f"2.9 GB (6 GB with CUDA), one to three minutes{compiling}"
    )


def main() -> int:
    """Print the announcement, or the refusal; 2 when it cannot be installed."""
    compiler = os.environ.get("CXX") or sysconfig.get_config_var("CXX") or "c++"
    reason = refusal(compiler.split()[0])
    file = sys.stderr if reason else sys.stdout
    print(reason or announcement(), file=file, flush=True)
    return 2 if reason else 0


if __name__ == "__main__":
    sys.exit(main())
