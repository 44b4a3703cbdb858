"""Parameters that a person types are checked before anything runs."""

import argparse
import os
from pathlib import Path
from typing import Any, Optional

import nbformat
import pytest

from companion.__main__ import main
from companion.pages import notebook, notebook_command, parameters
from sidm.config import ConfigError


def write_notebook(path: Path, *cells: str, parameters: str = "") -> Path:
    made = nbformat.v4.new_notebook()
    made.metadata["kernelspec"] = {
        "name": "python3",
        "display_name": "Python 3",
        "language": "python",
    }
    first = "from typing import Optional"
    made.cells = [
        nbformat.v4.new_code_cell(text) for text in (first, parameters, *cells)
    ]
    made.cells[1].metadata["tags"] = ["parameters"]
    for number, cell in enumerate(made.cells):
        cell["id"] = f"cell-{number}"
    path.parent.mkdir(parents=True, exist_ok=True)
    nbformat.write(made, path)
    return path


@pytest.fixture
def project(tmp_path, monkeypatch):
    """A project of two notebooks; the working folder is its root."""
    (tmp_path / "companion" / "pages").mkdir(parents=True)
    lines = [
        "preset: str = 'laptop'  # the sizes",
        "minutes: float = 5.0  # of novice data, min, above 0",
        "run_missing: bool = False  # trials that are not stored",
        "seeds: list[int] = [0, 1]  # of the trials",
        "system: Optional[str] = None  # only this one",
    ]
    write_notebook(
        tmp_path / "notebooks" / "01-first.ipynb",
        "from pathlib import Path",
        "print(preset, minutes, run_missing, seeds, system, Path.cwd().name)",
        parameters="\n".join(lines),
    )
    write_notebook(
        tmp_path / "notebooks" / "02-second.ipynb",
        parameters="spring: float = 1.0  # N/m",
    )
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def first(project):
    return project / "notebooks" / "01-first.ipynb"


def printed(path: Path) -> str:
    cells = nbformat.read(path, as_version=4).cells
    outputs = [output for cell in cells for output in cell.get("outputs", [])]
    return "".join(output.text for output in outputs if output.output_type == "stream")


def test_a_notebook_is_found_by_path_and_by_name(project, first):
    for name in (
        "notebooks/01-first.ipynb",
        "01-first",
        "first",
        "first.ipynb",
        "07-first",
    ):
        assert notebook.find_notebook(name).resolve() == first
    with pytest.raises(
        ConfigError, match="no notebook '01-frist'; did you mean '01-first'"
    ):
        notebook.find_notebook("01-frist")


def test_parameters_are_read_with_their_types_and_help(first):
    known = parameters.inspect(first)
    assert list(known) == ["preset", "minutes", "run_missing", "seeds", "system"]
    assert known["minutes"] == parameters.Parameter(
        "minutes", float, "5.0", "of novice data, min, above 0"
    )
    assert known["minutes"].value == 5.0 and known["system"].value is None
    assert known["seeds"].kind == list[int] and known["system"].kind == Optional[str]


def test_a_parameter_without_a_readable_type_is_an_error(project):
    for line in (
        "seed = 1",
        "seed: int | None = 1",
        "seed: Literal[1, 2] = 1",
        "seed: integer = 1",
        "seed: int",
        "print(1)",
    ):
        path = write_notebook(project / "notebooks" / "03-bad.ipynb", parameters=line)
        with pytest.raises(ConfigError, match="03-bad"):
            parameters.inspect(path)


def test_a_file_that_is_no_notebook_is_an_error(project):
    (project / "notebooks" / "note.ipynb").write_text("no notebook")
    with pytest.raises(ConfigError, match="not a notebook"):
        parameters.inspect(project / "notebooks" / "note.ipynb")


@pytest.mark.parametrize(
    ("text", "kind", "value"),
    [
        ("true", bool, True),
        ("3", int, 3),
        ("3", float, 3.0),
        ("1e-3", float, 0.001),
        ("true", str, "true"),
        ("3", str, "3"),
        ("[1, 2]", list[int], [1, 2]),
        ("[1, 2.5]", list[float], [1.0, 2.5]),
        ("null", Optional[int], None),
        ("4", Optional[int], 4),
        ("null", Optional[str], None),
        ("4", Optional[str], "4"),
        ("{a: 1}", dict[str, int], {"a": 1}),
        ("[0, 1]", tuple[int, float], [0, 1.0]),
    ],
)
def test_text_is_read_as_the_type_asks(text: str, kind: Any, value: Any):
    read = parameters.read_value(text, kind, "x")
    assert read == value and type(read) is type(value)


@pytest.mark.parametrize(
    ("text", "kind"),
    [
        ("yes please", bool),
        ("1", bool),
        ("2.5", int),
        ("true", int),
        ("true", float),
        ("5", list[int]),
        ("[a]", list[int]),
        ("abc", Optional[int]),
        ("[", int),
        ("{a: b}", dict[str, int]),
    ],
)
def test_text_of_another_type_is_an_error(text: str, kind: Any):
    with pytest.raises(ConfigError, match="'x'"):
        parameters.read_value(text, kind, "x")


@pytest.mark.parametrize(
    ("words", "inside", "outside"),
    [
        ("held, from -1 to 1", [-1, 0.5, 1], [-1.1, 5]),
        ("trajectories, at least 1", [1, 7], [0, -1]),
        ("rate, above 0", [1e-9], [0.0, -1.0]),
        (
            "of the study, one of novice, expert",
            ["novice"],
            ["robot", "novice, expert"],
        ),
        ("stops it, one of the end, the first rise or none", ["none"], ["the"]),
        ("values of p_e, from 0 to 1", [[], [0.0, 1.0]], [[0.5, 1.5]]),
        ("of the ground", [-1], []),
    ],
)
def test_a_value_lies_in_the_range_that_the_words_say(words, inside, outside):
    parameter = parameters.Parameter("x", Any, "", words)
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
        ("system", "system3", "'system3'"),
        ("systems", ["system1", "system3"], "'system3'"),
        ("first", "system1 robot", "'system1 robot'"),
    ],
)
def test_presets_and_robots_are_known_before_a_notebook_runs(name, value, words):
    with pytest.raises(ConfigError, match=words):
        parameters.refuse_out_of_range(value, parameters.Parameter(name, Any, "", ""))


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


def test_a_name_given_by_hand_must_be_this_notebooks(first):
    with pytest.raises(
        ConfigError, match="'minuts' in 01-first.ipynb; did you mean 'minutes'"
    ):
        parameters.merge_parameters(first, {"minuts": 1.0})
    with pytest.raises(
        ConfigError, match="'spring'"
    ):  # a parameter of another notebook
        parameters.merge_parameters(first, {"spring": 1.0})


def test_a_name_in_a_file_must_be_some_notebooks(project, first):
    preset = project / "smoke.yaml"
    preset.write_text("minutes: 1\nspring: 2.0\n")
    assert parameters.merge_parameters(first, {}, [preset]) == {"minutes": 1.0}
    preset.write_text("sprnig: 2.0\n")
    with pytest.raises(ConfigError, match="smoke.yaml .*did you mean 'spring'"):
        parameters.merge_parameters(first, {}, [preset])


def test_what_is_given_by_hand_wins_over_files_and_the_later_file_over_the_earlier(
    project, first
):
    (project / "a.yaml").write_text("minutes: 1\nseeds: [1]\npreset: smoke")
    (project / "b.yaml").write_text("minutes: 2\nseeds: [2]")
    merged = parameters.merge_parameters(
        first, {"minutes": 3.0}, [project / "a.yaml", project / "b.yaml"]
    )
    assert merged == {"minutes": 3.0, "seeds": [2], "preset": "smoke"}


@pytest.mark.parametrize(
    "text", ["minutes: long", "run_missing: 1", "- minutes", "minutes: [", None]
)
def test_a_file_that_cannot_be_used_is_one_line(project, first, text):
    if text is not None:
        (project / "preset.yaml").write_text(text)
    with pytest.raises(ConfigError, match="preset.yaml") as caught:
        parameters.merge_parameters(first, {}, [project / "preset.yaml"])
    assert "\n" not in str(caught.value)


def test_a_run_gets_its_values_and_the_projects_folder(project):
    arguments = (
        "first out/mine.ipynb -p run_missing true -p system system2 -p minutes 2"
    ).split()
    assert main(["notebook", *arguments]) == 0
    assert (
        printed(project / "out" / "mine.ipynb")
        == f"laptop 2.0 True [0, 1] system2 {project.name}\n"
    )


def test_a_failing_cell_is_one_line_and_status_1(project, capsys):
    write_notebook(
        project / "notebooks" / "03-fails.ipynb",
        "print('before')",
        "1 / 0",
        parameters="a: int = 1  # a",
    )
    assert main(["notebook", "fails"]) == 1
    lines = [
        line
        for line in capsys.readouterr().err.splitlines()
        if line.startswith("companion: ")
    ]
    assert len(lines) == 1 and "ZeroDivisionError: division by zero" in lines[0]
    assert "before" in printed(project / "_build" / "runs" / "03-fails.ipynb")


@pytest.mark.parametrize(
    "words",
    [
        ["third"],
        ["first", "-p", "minuts", "1"],
        ["first", "-p", "minutes", "long"],
        ["first", "-p", "minutes", "0"],
        ["first", "-p", "preset", "laptob"],
        ["first", "-p", "seeds", "[]"],
        ["first", "-f", "none.yaml"],
        ["all", "-p", "minutes", "1"],
        ["all", "--jobs", "0"],
        ["first", "--in-place", "-p", "minutes", "1"],
    ],
)
def test_arguments_that_cannot_be_used_are_status_2_and_nothing_runs(
    project, capsys, words
):
    assert main(["notebook", *words]) == 2
    assert capsys.readouterr().err.count("\n") == 1
    assert not (project / "_build").exists()


def test_parameters_are_listed(project, capsys):
    assert main(["notebook", "all", "--list"]) == 0
    assert (
        "  minutes: float = 5.0  # of novice data, min, above 0"
        in capsys.readouterr().out.splitlines()
    )


@pytest.mark.more
def test_refreshing_twice_changes_nothing(first):
    assert main(["notebook", str(first), "--in-place"]) == 0
    once = first.read_bytes()
    assert "laptop 5.0 False [0, 1] None" in printed(first)
    assert main(["notebook", str(first), "--in-place"]) == 0
    assert first.read_bytes() == once


def test_the_project_is_found_from_below_and_from_elsewhere(
    project, monkeypatch, tmp_path_factory
):
    monkeypatch.chdir(project / "notebooks")
    assert notebook.enter_project() == project and Path(os.getcwd()) == project
    assert (
        notebook.project_root(tmp_path_factory.mktemp("away"))
        == Path(notebook.__file__).parents[2]
    )


def test_paths_are_read_from_where_the_user_stands(tmp_path, monkeypatch):
    """Files that are there, and folders; other texts stay as they are."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "drives.csv").write_text("")
    given = {"novice": "drives.csv", "expert": "system1 expert", "data": "mine"}
    words = [word for item in given.items() for word in ("-p", *item)]
    parser = argparse.ArgumentParser()
    notebook_command.add_arguments(parser)
    arguments = parser.parse_args(["own-robot", "out.ipynb", *words])
    path = notebook.find_notebook("own-robot")
    values = notebook_command._run_of(path, arguments).values
    assert values["novice"] == str(tmp_path / "drives.csv")
    assert values["data"] == str(tmp_path / "mine")
    assert values["expert"] == "system1 expert"
    monkeypatch.chdir(Path(__file__).parents[2])
    assert notebook_command._run_of(path, arguments).values["novice"] == "drives.csv"
