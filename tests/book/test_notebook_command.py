"""`companion notebook`: parameters are checked, then kernels run, none is left."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any, Optional

import nbformat
import pytest
from nbclient import NotebookClient

from companion.__main__ import build_parser, main
from companion.pages import notebook, notebook_command, parameters
from companion.pages.parameters import Parameter
from sidm import progress
from sidm.config import ConfigError

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
    """A project without notebooks; the working folder is its root."""
    (tmp_path / "companion" / "pages").mkdir(parents=True)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def add(
    project: Path, name: str, *cells: str, parameters: str = "a: int = 1  # a"
) -> Path:
    """Write a notebook of the project."""
    made = nbformat.v4.new_notebook()
    kernel = {"name": "python3", "display_name": "Python 3", "language": "python"}
    made.metadata["kernelspec"] = kernel
    first = f"from typing import Optional\n{AWAIT}"
    texts = first, parameters, *cells
    made.cells = [nbformat.v4.new_code_cell(text) for text in texts]
    made.cells[1].metadata["tags"] = ["parameters"]
    for number, cell in enumerate(made.cells):
        cell["id"] = f"cell-{number}"
    path = project / "notebooks" / f"{name}.ipynb"
    path.parent.mkdir(exist_ok=True)
    nbformat.write(made, path)
    return path


@pytest.fixture
def first(project):
    """The first of the project's two notebooks."""
    lines = [
        "preset: str = 'laptop'  # the sizes",
        "minutes: float = 5.0  # of novice data, min, above 0",
        "run_missing: bool = False  # trials that are not stored",
        "seeds: list[int] = [0, 1]  # of the trials",
        "system: Optional[str] = None  # only this one",
    ]
    show = "print(preset, minutes, run_missing, seeds, system, Path.cwd().name)"
    add(project, "02-second", parameters="spring: float = 1.0  # N/m")
    return add(project, "01-first", show, parameters="\n".join(lines))


def printed(path: Path) -> str:
    cells = nbformat.read(path, as_version=4).cells
    outputs = [output for cell in cells for output in cell.get("outputs", [])]
    return "".join(output.text for output in outputs if output.output_type == "stream")


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


@pytest.mark.parametrize(
    "name", ["notebooks/01-first.ipynb", "01-first", "first", "first.ipynb", "07-first"]
)
def test_a_notebook_is_found_by_path_and_by_name(first, name):
    assert notebook.find_notebook(name).resolve() == first


def test_the_project_is_found_from_below_and_from_elsewhere(
    project, first, monkeypatch, tmp_path_factory
):
    monkeypatch.chdir(project / "notebooks")
    assert notebook.enter_project() == project and Path(os.getcwd()) == project
    away = notebook.project_root(tmp_path_factory.mktemp("away"))
    assert away == Path(notebook.__file__).parents[2]


def test_parameters_are_read_with_their_types_and_help(first):
    known = parameters.inspect(first)
    assert list(known) == ["preset", "minutes", "run_missing", "seeds", "system"]
    words = "of novice data, min, above 0"
    assert known["minutes"] == Parameter("minutes", "float", "5.0", words)
    assert known["minutes"].value == 5.0 and known["system"].value is None
    assert known["seeds"].kind == list[int] and known["system"].kind == Optional[str]


@pytest.mark.parametrize(
    "line",
    [
        "seed = 1",
        "seed: integer = 1",
        "seed: int",
        "print(1)",
        "",
        "x: ().__class__.__base__.__subclasses__() = 1  # help",
        "x: open('sprung', 'w') = 1  # help",
        "x: list[int = 1  # help",
        "x: [int for _ in [1]] = 1  # help",
        f"x: {'x' * 10**5} = 1  # help",
    ],
)
def test_a_parameter_without_a_readable_type_is_an_error(project, line):
    """An annotation is not executed."""
    path = add(project, "03-bad", parameters=line)
    with pytest.raises(ConfigError, match="03-bad") as caught:
        parameters.inspect(path)
    assert "\n" not in str(caught.value) and not Path("sprung").exists()
    path.write_text("no notebook")
    with pytest.raises(ConfigError, match="not a notebook"):
        parameters.inspect(path)


@pytest.mark.parametrize(
    ("text", "kind", "value"),
    [
        ("true", bool, True),
        ("3", float, 3.0),
        ("1e-3", float, 0.001),
        ("3", str, "3"),
        ("[1, 2.5]", list[float], [1.0, 2.5]),
        ("null", Optional[int], None),
        ("null", Optional[str], None),
        ("4", Optional[str], "4"),
    ],
)
def test_text_is_read_as_the_type_asks(text: str, kind: Any, value: Any):
    read = parameters.read_value(text, kind, "x")
    assert read == value and type(read) is type(value)


@pytest.mark.parametrize(
    ("words", "inside", "outside"),
    [
        ("held, from -1 to 1", [-1, 0.5, 1], [-1.1, 5]),
        ("trajectories, at least 1", [1, 7], [0, -1]),
        ("rate, above 0", [1e-9], [0.0, -1.0]),
        ("stops it, one of the end, the first rise or none", ["none"], ["the"]),
        ("values of p_e, from 0 to 1", [[], [0.0, 1.0]], [[0.5, 1.5]]),
        ("of the ground", [-1], []),
    ],
)
def test_a_value_lies_in_the_range_that_the_words_say(words, inside, outside):
    parameter = Parameter("x", "", "", words)
    for value in inside:
        parameters.refuse_out_of_range(value, parameter)
    for value in outside:
        with pytest.raises(ConfigError, match="'x' must be "):
            parameters.refuse_out_of_range(value, parameter)


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("preset", "labtop", "'labtop'"),
        ("preset", "laptop sedes=2", "'sedes'"),
        ("policy", "hold", "did you mean 'held'"),
        ("systems", ["system1", "system3"], "'system3'"),
        ("first", "system1 robot", "'system1 robot'"),
    ],
)
def test_presets_and_robots_are_known_before_a_notebook_runs(name, value, words):
    with pytest.raises(ConfigError, match=words):
        parameters.refuse_out_of_range(value, Parameter(name, "", "", ""))


def test_what_is_given_by_hand_wins_over_files_and_the_later_file_over_the_earlier(
    project, first
):
    """A file may have parameters of other notebooks."""
    (project / "a.yaml").write_text("minutes: 1\nseeds: [1]\npreset: smoke\nspring: 2")
    (project / "b.yaml").write_text("minutes: 2\nseeds: [2]")
    files = [project / "a.yaml", project / "b.yaml"]
    merged = parameters.merge_parameters(first, {"minutes": 3.0}, files)
    assert merged == {"minutes": 3.0, "seeds": [2], "preset": "smoke"}


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["third"], "no notebook 'third'; "),
        (["frist"], "did you mean '01-first'"),
        (["first", "-p", "minuts", "1"], "in 01-first.ipynb; did you mean 'minutes'"),
        (["first", "-p", "spring", "1"], "unknown parameter 'spring'"),
        (["first", "-p", "minutes", "long"], "'minutes' must be float"),
        (["first", "-p", "seeds", "[a]"], "'seeds' must be"),
        (["first", "-p", "minutes", "["], "'minutes' cannot be read as YAML"),
        (["first", "-p", "minutes", "0"], "'minutes' must be above 0, not 0.0"),
        (["first", "-p", "preset", "laptob"], "'laptob'"),
        (["first", "-p", "seeds", "[]"], "'seeds' must have at least one value"),
        (["first", "-f", "none.yaml"], "none.yaml: no such parameter file"),
        (["first", "-f", "sprnig: 2"], "did you mean 'spring'"),
        (["first", "-f", "minutes: long"], "file.yaml: minutes' must be float"),
        (["first", "-f", "- minutes"], "a parameter file is a mapping"),
        (["first", "-f", "minutes: ["], "file.yaml: not YAML"),
        (["all", "-p", "minutes", "1"], "-p is for one notebook"),
        (["all", "--jobs", "0"], "--jobs must be at least 1, not 0"),
        (["first", "--in-place", "-p", "minutes", "1"], "--in-place refreshes"),
    ],
)
def test_what_cannot_be_used_is_one_line_and_status_2_and_nothing_runs(
    project, first, capsys, words, said
):
    if "-f" in words and words[-1] != "none.yaml":
        (project / "file.yaml").write_text(words.pop())
        words = [*words, "file.yaml"]
    assert main(["notebook", *words]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and said in error
    assert not (project / "_build").exists()


@pytest.mark.parametrize("way", ["itself", "symlink", "hard link", "all"])
def test_a_run_is_never_written_over_a_notebook(project, first, capsys, way):
    before, link = first.read_bytes(), project / "link.ipynb"
    if way == "symlink":
        link.symlink_to(first)
    elif way == "hard link":
        os.link(first, link)
    words = {"itself": ["first", str(first)], "all": ["all", "notebooks"]}
    assert main(["notebook", *words.get(way, ["first", str(link)])]) == 2
    assert "itself: name another file" in capsys.readouterr().err
    assert first.read_bytes() == before


def test_parameters_are_listed(first, capsys):
    assert main(["notebook", "all", "--list"]) == 0
    line = "  minutes: float = 5.0  # of novice data, min, above 0"
    assert line in capsys.readouterr().out.splitlines()


def test_paths_are_read_from_where_the_user_stands(tmp_path, monkeypatch):
    """Files that are there, and folders; other texts stay as they are."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "drives.csv").write_text("")
    given = {"novice": "drives.csv", "expert": "system1 expert", "data": "mine"}
    words = [word for item in given.items() for word in ("-p", *item)]
    arguments = build_parser().parse_args(["notebook", "own-robot", "out", *words])
    path = notebook.find_notebook("own-robot")
    values = notebook_command._run_of(path, arguments).values
    assert values["novice"] == str(tmp_path / "drives.csv")
    assert values["data"] == str(tmp_path / "mine")
    assert values["expert"] == "system1 expert"
    monkeypatch.chdir(Path(__file__).parents[2])
    assert notebook_command._run_of(path, arguments).values["novice"] == "drives.csv"


def test_a_run_gets_its_values_and_the_projects_folder(project, first):
    words = "-p run_missing true -p system system2 -p minutes 2".split()
    assert main(["notebook", "first", "out/mine.ipynb", *words]) == 0
    shown = f"laptop 2.0 True [0, 1] system2 {project.name}\n"
    assert printed(project / "out" / "mine.ipynb") == shown


@pytest.mark.more
def test_refreshing_twice_changes_nothing(first):
    assert main(["notebook", str(first), "--in-place"]) == 0
    once = first.read_bytes()
    assert "laptop 5.0 False [0, 1] None" in printed(first)
    assert main(["notebook", str(first), "--in-place"]) == 0
    assert first.read_bytes() == once


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
    for name in ("one", "two"):
        assert printed(project / "out" / f"{name}.ipynb") == "1\n"


def test_a_failure_stops_the_others_and_no_kernel_is_left(project, capsys):
    until_kernel = "while not list(Path().glob('*.kernel')): time.sleep(0.1)"
    add(project, "1-fails", until_kernel, "print('so far')", "1 / 0")
    add(project, "2-endless", ENDLESS)
    add(project, "3-waits", "Path('begun').touch()")
    assert main(["notebook", "all", "out", "--jobs", "2"]) == 1
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.splitlines()[-1].endswith(
        "1-fails.ipynb: cell 5 failed, ZeroDivisionError: division by zero; "
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
    said = "dies.ipynb: its kernel died (out of memory?); the notebook is unchanged"
    assert said in capsys.readouterr().err
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
    words = [sys.executable, "-P", "-c", program]
    with subprocess.Popen(words, stderr=subprocess.PIPE, text=True) as process:
        while len(kernels(project)) < 2:
            assert process.poll() is None
        process.send_signal(signal.SIGINT)
        _, error = process.communicate()
    assert process.returncode == 1 and error.startswith("companion: stopped")
    assert all(gone(kernel) for kernel in kernels(project))


@pytest.mark.more
def test_notebooks_that_run_trials_do_it_in_turn(project, monkeypatch):
    """The notebooks share trials, and none is trained twice; the environment stays."""
    monkeypatch.setenv("OMP_NUM_THREADS", "3")
    note = "with open('log', 'a') as file: print('{}', file=file, flush=True)"
    steps = [(name, what) for name in "123" for what in ("begins", "ends")]
    for name in "123":
        cells = [note.format(f"{name} {what}") for what in ("begins", "ends")]
        missing = "run_missing: bool = False  # run it"
        add(project, name, *cells, THREADS, parameters=missing)
    (project / "all.yaml").write_text("run_missing: true")
    assert main(["notebook", "all", "out", "-f", "all.yaml", "--jobs", "3"]) == 0
    log = (project / "log").read_text().splitlines()
    assert log == [f"{name} {what}" for name, what in steps]
    assert printed(project / "out" / "1.ipynb") == "3\n"


@pytest.mark.more
@pytest.mark.parametrize(("failures", "status"), [(2, 0), (3, 1)])
def test_a_kernel_that_does_not_answer_is_started_again(
    project, monkeypatch, capsys, failures, status
):
    """A kernel dies if another chose the same port: it chooses before it takes it."""
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
