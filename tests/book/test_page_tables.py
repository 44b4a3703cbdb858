"""Tables of results on pages, and lines on where results come from."""

import pandas as pd
import pytest

from companion import Results
from companion.engine.frame import frame_of
from companion.pages.markdown import (
    markdown_table,
    provenance_block,
    provenance_html,
    provenance_line,
    stored_count,
    stored_line,
    table_html,
    table_markdown,
    titled_table,
)


@pytest.fixture
def trials(laptop):
    return laptop.points("system1", ["sidm"], [1, 2]) + laptop.points(
        "system2", ["sidm"], [1]
    )


def test_what_is_missing_is_counted_by_system_with_the_command_that_runs_it(
    tmp_path, trials, make_row
):
    store = Results(tmp_path)
    assert stored_line(store, trials, "run it") == (
        "9 of 9 trials are missing (6 of system 1, 3 of system 2); `run it` runs them."
    )
    for trial in trials[:6]:
        store.put(make_row(trial))
    assert "3 of 9 trials are missing (0 of system 1, 3 of system 2)" in stored_line(
        store, trials, "run it"
    )
    for trial in trials[6:]:
        store.put(make_row(trial))
    assert (
        stored_line(store, trials, "run it")
        == "All 9 trials that this notebook can run are stored."
    )


def test_pairs_of_robots_have_names_in_words():
    table = pd.DataFrame({"system": ["system1", "system2_free_struts", "systems"]})
    names = ["system 1", "system 2, free struts", "systems"]
    assert titled_table("system1", table).splitlines() == [
        "**system 1**",
        "",
        "| system |",
        "| --- |",
        *(f"| {name} |" for name in names),
    ]
    assert all(f"<td>{name}</td>" in table_html(table) for name in names)


def test_what_a_study_lacks_is_counted_with_the_command_that_makes_it():
    said = "2 of 3 models are stored; `run it` makes the others."
    assert stored_count(2, 3, "models", "run it") == said
    assert stored_count(3, 3, "models", "run it") == "All 3 models are stored."


def test_a_provenance_line_counts_trials_and_names_the_command(figure3_frame):
    line = provenance_line(figure3_frame, "companion run")
    assert line.startswith("108 trials; ")
    assert "older code" not in line
    assert line.endswith("; again: `companion run`.")
    older = figure3_frame.assign(stale=True, repeated=True)
    assert (
        "108 of them made by older code, 108 from data reproduced on another machine"
        in provenance_line(older)
    )
    assert (
        provenance_line(figure3_frame[:0], "cmd")
        == "No trials stored; `cmd` runs them."
    )


def test_a_provenance_block_folds_the_line_behind_its_count(figure3_frame):
    for frame in (frame_of([]), figure3_frame):
        lines = provenance_block(frame, "run it").splitlines()
        count, rest = provenance_line(frame, "run it").split("; ", 1)
        assert lines == [
            f'<details class="provenance"><summary>{count}</summary>',
            "",
            rest,
            "",
            "</details>",
        ]
    assert provenance_html(frame_of([]), "run <it>") == (
        '<details class="provenance"><summary>No trials stored</summary>'
        "<p><code>run &lt;it&gt;</code> runs them.</p></details>"
    )


def test_a_table_rounds_floats_and_keeps_all_else():
    table = pd.DataFrame(
        {"name": ["a < b", "b"], "loss": [1.23456, float("nan")], "seeds": [3, 4]}
    )
    assert table_markdown(table).splitlines()[2:] == [
        "| a < b | 1.23 | 3 |",
        "| b | - | 4 |",
    ]
    assert "<td>a &lt; b</td><td>1.23</td><td>3</td>" in table_html(table)
    assert markdown_table(["name"], []) == "No trials stored."
    assert markdown_table(["kind"], [("Body | None",)]).endswith("| Body \\| None |\n")
    assert table_html(table[:0]) == "<p>No trials stored.</p>"
