"""Workers: this process or new ones, and scripts that would run again in each."""

import subprocess
import sys

import pytest

from sidm.pool import as_completed, local_pool

SCRIPT = """
import os
from sidm.pool import local_pool

def main():
    with local_pool({workers}) as pool:
        print(pool.submit(os.getpid).result() == os.getpid())

"""


def test_one_worker_runs_each_call_once_when_its_turn_comes():
    done: list[int] = []
    with local_pool(1) as pool:
        futures = [pool.submit(done.append, number) for number in range(3)]
        for count, future in enumerate(as_completed(futures), 1):
            assert done == list(range(count)) and future.result() is None
        assert done == [0, 1, 2]
        with pytest.raises(ValueError, match="no"):
            pool.submit(int, "no").result()


@pytest.mark.parametrize(
    ("workers", "call", "error"),
    [
        (1, "main()\n", None),
        (2, 'if __name__ == "__main__":\n    main()\n', None),
        (2, "for _ in range(1):\n    main()\n", "line 10: with more than one worker"),
    ],
    ids=["one worker", "guarded", "without guard"],
)
def test_a_script_uses_this_process_or_others(tmp_path, workers, call, error):
    script = tmp_path / "script.py"
    script.write_text(SCRIPT.format(workers=workers) + call)
    result = subprocess.run(
        [sys.executable, script.name], cwd=tmp_path, capture_output=True, text=True
    )
    if error is None:
        assert result.stdout == f"{workers == 1}\n", result.stderr
    else:
        assert result.returncode == 1 and "Process" not in result.stderr
        last = result.stderr.splitlines()[-1]
        assert error in last and "if __name__ ==" in last and "workers=1" in last
