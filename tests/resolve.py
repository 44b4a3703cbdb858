"""Do the requirements resolve against the index alone, with every supported Python?

`python -m tests.resolve` asks pip, in an empty environment of each Python that is
found here and without local files or configuration. Nothing is installed. The oldest
pip that a Python brings has to do.
"""

import os
import shutil
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

ROOT = Path(__file__).parents[1]
PYTHONS = ("3.11", "3.12", "3.13")
OLDEST_PIP = {"3.11": "22.3"}  # what 3.11.0 brings; its resolver backtracks most
#: what a machine's own packages come by; an index that replaces the public one stays
LOCAL = ("PIP_FIND_LINKS", "PIP_EXTRA_INDEX_URL", "PIP_CONSTRAINT", "PIP_NO_INDEX")
ENVIRONMENT = {name: value for name, value in os.environ.items() if name not in LOCAL}
ENVIRONMENT |= {"PIP_CONFIG_FILE": os.devnull, "PIP_DISABLE_PIP_VERSION_CHECK": "1"}


def interpreters() -> dict[str, str]:
    """Version -> command of each supported Python on this machine."""
    found = {}
    pyenv = Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv")) / "versions"
    for version in PYTHONS:
        candidates = [sys.executable, *pyenv.glob(f"{version}.*/bin/python")]
        candidates.append(shutil.which(f"python{version}") or "")
        for command in filter(None, map(str, candidates)):
            code = "import sys, venv; print('{}.{}'.format(*sys.version_info))"
            answer = run(command, "-c", code)
            if answer.stdout.strip() == version:
                found[version] = command
                break
    return found


def run(*words: str) -> subprocess.CompletedProcess:
    return subprocess.run(words, capture_output=True, text=True, env=ENVIRONMENT)


def resolve(version: str, command: str) -> str:
    """A line about one Python; it ends in pip's words if the requirements fail."""
    begun = time.monotonic()
    with tempfile.TemporaryDirectory() as folder:
        python = str(Path(folder, "bin", "python"))
        pip = python, "-m", "pip", "install", "--quiet"
        steps = [(command, "-m", "venv", folder)]
        if version in OLDEST_PIP:
            steps.append((*pip, f"pip=={OLDEST_PIP[version]}"))
        steps.append((*pip, "--dry-run", "-r", str(ROOT / "requirements.txt")))
        for step in steps:
            done = run(*step)
            if done.returncode:
                return f"{version}: FAILED\n{done.stderr[-2000:]}"
    return f"Python {version}: resolved in {time.monotonic() - begun:.0f} s"


def main() -> int:
    found = interpreters()
    with ThreadPoolExecutor(len(PYTHONS)) as pool:
        lines = list(pool.map(resolve, found, found.values()))
    print("\n".join(lines), flush=True)
    missing = [version for version in PYTHONS if version not in found]
    if missing:
        print(f"not found here: Python {', '.join(missing)}")
    return int(not found or any("FAILED" in line for line in lines))


if __name__ == "__main__":
    sys.exit(main())
