"""Notebooks run on real kernels: side by side, in turn, and after a failure."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from nbclient import NotebookClient
from test_notebook import printed, write_notebook

from companion.__main__ import main
from sidm import progress

PATIENCE = 3000  # tenths of a second until a cell stops waiting
AWAIT = f"""
import os
import time
from pathlib import Path
def wait(name):
    for _ in range({PATIENCE}):
        if Path(name).exists():
            return
        time.sleep(0.1)
    raise RuntimeError(f"{{name}} never came")
"""
THREADS = "print(os.environ['OMP_NUM_THREADS'])"
ENDLESS = "Path(f'{os.getpid()}.kernel').touch()\nwhile True: time.sleep(0.1)"


@pytest.fixture
def project(tmp_path, monkeypatch):
    """An empty project; the working folder is its root."""
    (tmp_path / "companion" / "pages").mkdir(parents=True)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def add(
    project: Path, name: str, *cells: str, parameters: str = "a: int = 1  # a"
) -> Path:
    return write_notebook(
        project / "notebooks" / f"{name}.ipynb", AWAIT, *cells, parameters=parameters
    )


def kernels(project: Path) -> list[int]:
    """Process numbers of the kernels that run ENDLESS."""
    return [int(path.stem) for path in project.glob("*.kernel")]


def gone(process: int) -> bool:
    """Whether a kernel ends; it looks for its parent now and then."""
    for _ in range(PATIENCE):
        try:
            os.kill(process, 0)
        except ProcessLookupError:
            return True
        time.sleep(0.1)
    return False


@pytest.mark.more
def test_they_run_side_by_side_on_one_thread_each(project, monkeypatch, capsys):
    monkeypatch.delenv("OMP_NUM_THREADS", raising=False)
    monkeypatch.setattr(progress, "LOG_INTERVAL", 0.0)  # a line at every step
    for own, other in (("one", "two"), ("two", "one")):
        add(project, own, f"Path('{own}').touch()", f"wait('{other}')", THREADS)
    assert main(["notebook", "all", "out", "--jobs", "2"]) == 0
    captured = capsys.readouterr()
    assert sorted(captured.out.splitlines()) == ["out/one.ipynb", "out/two.ipynb"]
    assert "notebooks: 2/2 notebook" in captured.err
    assert [printed(project / "out" / f"{name}.ipynb") for name in ("one", "two")] == [
        "1\n",
        "1\n",
    ]


def test_a_failure_stops_the_others_and_no_kernel_is_left(project, capsys):
    add(
        project,
        "1-fails",
        "while not list(Path().glob('*.kernel')): time.sleep(0.1)",
        "print('so far')",
        "1 / 0",
    )
    add(project, "2-endless", ENDLESS)
    add(project, "3-waits", "Path('begun').touch()")
    assert main(["notebook", "all", "out", "--jobs", "2"]) == 1
    captured = capsys.readouterr()
    assert captured.out == ""
    line = captured.err.splitlines()[-1]
    assert line.endswith(
        "1-fails.ipynb: cell 6 failed, ZeroDivisionError: division by zero; "
        "the run up to there is out/1-fails.ipynb"
    )
    assert printed(project / "out" / "1-fails.ipynb") == "so far\n"
    assert not (project / "begun").exists()
    [kernel] = kernels(project)
    assert gone(kernel)


@pytest.mark.more
def test_a_kernel_that_dies_is_a_failure(project, capsys):
    path = add(project, "dies", "os._exit(1)")
    before = path.read_bytes()
    assert main(["notebook", "dies", "--in-place"]) == 1
    assert (
        "dies.ipynb: its kernel died (out of memory?); the notebook is unchanged"
        in capsys.readouterr().err
    )
    assert path.read_bytes() == before


@pytest.mark.more
def test_ctrl_c_leaves_no_kernel(project):
    add(project, "1", ENDLESS)
    add(project, "2", ENDLESS)
    program = """
import signal, sys
from companion.__main__ import main
signal.signal(signal.SIGINT, signal.default_int_handler)
sys.exit(main(["notebook", "all", "--jobs", "2"]))
"""
    with subprocess.Popen(
        [sys.executable, "-P", "-c", program], stderr=subprocess.PIPE, text=True
    ) as process:
        while len(kernels(project)) < 2:
            assert process.poll() is None
        process.send_signal(signal.SIGINT)
        _, error = process.communicate()
    assert process.returncode == 1 and error.startswith("companion: stopped")
    assert all(gone(kernel) for kernel in kernels(project))


@pytest.mark.more
def test_notebooks_that_run_trials_do_it_in_turn(project):
    """Notebooks share trials; no trial must be trained twice at the same time."""
    note = "with open('log', 'a') as file: print('{}', file=file, flush=True)"
    for name in ("1", "2", "3"):
        cells = [note.format(f"{name} {what}") for what in ("begins", "ends")]
        add(project, name, *cells, parameters="run_missing: bool = False  # run it")
    (project / "all.yaml").write_text("run_missing: true")
    assert main(["notebook", "all", "out", "-f", "all.yaml", "--jobs", "3"]) == 0
    wanted = [
        f"{name} {what}" for name in ("1", "2", "3") for what in ("begins", "ends")
    ]
    assert (project / "log").read_text().splitlines() == wanted


@pytest.mark.more
def test_what_stands_in_the_environment_stays(project, monkeypatch):
    monkeypatch.setenv("OMP_NUM_THREADS", "3")
    for name in ("1", "2"):
        add(project, name, THREADS)
    assert main(["notebook", "all", "out", "--jobs", "2"]) == 0
    assert os.environ["OMP_NUM_THREADS"] == "3"
    assert printed(project / "out" / "1.ipynb") == "3\n"


@pytest.mark.more
@pytest.mark.parametrize(("failures", "status"), [(2, 0), (3, 1)])
def test_a_kernel_that_does_not_answer_is_started_again(
    project, monkeypatch, capsys, failures, status
):
    """A kernel dies if another kernel chose the same port.

    Kernels choose free ports before they take them.
    """
    path = add(project, "01-one", "print('here')")
    real = NotebookClient.start_new_kernel_client
    left = [failures]

    def start(client):
        if left[0]:
            left[0] -= 1
            raise RuntimeError("Kernel died before replying to kernel_info")
        return real(client)

    monkeypatch.setattr(NotebookClient, "start_new_kernel_client", start)
    assert main(["notebook", str(path), "--in-place"]) == status
    assert ("its kernel did not start" in capsys.readouterr().err) == bool(status)
