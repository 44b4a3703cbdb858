"""Workers: this process or new ones, and scripts that would run again in each."""

import os
import subprocess
import sys

import pytest

from sidm.pool import as_completed, local_pool

SCRIPT = """
from sidm.pool import local_pool

def main():
    with local_pool({workers}) as pool:
        print(pool.submit(max, 1, 2).result())

"""


def fail():
    raise ValueError("no")


def test_one_worker_is_this_process():
    with local_pool(1) as pool:
        futures = [pool.submit(os.getpid), pool.submit(fail), pool.submit(max, 1, 2)]
        assert list(as_completed(futures)) == futures
        assert futures[0].result() == os.getpid()
        with pytest.raises(ValueError, match="no"):
            futures[1].result()
        assert futures[2].result() == 2
        assert list(pool.map(abs, [-1, 2])) == [1, 2]


def test_a_call_runs_once_when_its_turn_comes():
    done: list[int] = []
    with local_pool(1) as pool:
        futures = [pool.submit(done.append, number) for number in range(3)]
        for count, future in enumerate(as_completed(futures), 1):
            future.result()
            assert done == list(range(count))


def test_more_workers_are_other_processes():
    with local_pool(2) as pool:
        assert pool.submit(os.getpid).result() != os.getpid()


@pytest.mark.parametrize(
    ("workers", "call", "error"),
    [
        (1, "main()\n", None),
        (2, 'if __name__ == "__main__":\n    main()\n', None),
        (2, "for _ in range(1):\n    main()\n", "line 9: with more than one worker"),
    ],
    ids=["one worker", "guarded", "without guard"],
)
def test_a_script_uses_workers(tmp_path, workers, call, error):
    script = tmp_path / "script.py"
    script.write_text(SCRIPT.format(workers=workers) + call)
    result = subprocess.run(
        [sys.executable, script.name], cwd=tmp_path, capture_output=True, text=True
    )
    if error is None:
        assert result.stdout == "2\n", result.stderr
    else:
        assert result.returncode == 1 and "Process" not in result.stderr
        last = result.stderr.splitlines()[-1]
        assert error in last and "if __name__ ==" in last and "workers=1" in last
