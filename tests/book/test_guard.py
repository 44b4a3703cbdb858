"""Sentences of the book are checked against the results."""

import shutil
from pathlib import Path

import pytest
from changed import change
from pages import ROOT
from places import one_at_a_time, shared_by_workers

from companion.pages.guard import Outdated, check_claims
from companion.pages.notebook import notebooks
from companion.pages.notebook_runs import NotebookError, Run, execute
from companion.tasks.run import records
from sidm.config import replace

#: chapters with sentences about stored results; others simulate their results
GUARDED = [
    pytest.param(path, id=path.stem)
    for path in notebooks(ROOT)
    if all(
        words in path.read_text(encoding="utf-8")
        for words in ("check_claims(", "preset: str")
    )
]


@pytest.fixture(scope="session")
def other_results(tmp_path_factory) -> Path:
    """Stored results whose values were exchanged between trials."""
    folder = shared_by_workers(tmp_path_factory) / "changed"
    with one_at_a_time(folder):
        if not (folder / "done").exists():
            shutil.rmtree(folder, ignore_errors=True)
            change(ROOT / "results", folder)
            (folder / "done").touch()
    return folder


@pytest.mark.more
@pytest.mark.parametrize("path", GUARDED)
def test_a_chapter_stops_where_the_results_say_otherwise(path, other_results, tmp_path):
    with pytest.raises(
        NotebookError, match="Outdated: the stored results no longer bear out"
    ):
        execute(
            [Run(path, tmp_path / path.name, {"results": str(other_results)})], ROOT
        )


@pytest.mark.more
def test_the_chapter_on_rivals_stands_where_an_entered_method_wins(tmp_path):
    """A contributed row changes the table; the sentences are about the library's."""
    shutil.copytree(ROOT / "results", tmp_path / "results")
    store = records(tmp_path / "results")
    for row in [row for row in store.all() if row.about.method == "gp"]:
        entered = replace(row.about, method="best.py:Best", code=12 * "a")
        store.put(replace(row, about=entered, loss=0.5 * row.loss))
    (path,) = (path for path in notebooks(ROOT) if path.stem == "06-rivals")
    results = {"results": str(tmp_path / "results")}
    execute([Run(path, tmp_path / path.name, results)], ROOT)


def test_words_that_hold_need_no_word():
    assert check_claims({"more is less": lambda: True}, "laptop") is None


def test_a_sentence_that_no_longer_holds_is_named():
    with pytest.raises(
        Outdated, match="no longer bear out 'more is less': write the page anew"
    ):
        check_claims(
            {"less is more": lambda: True, "more is less": lambda: False}, "laptop"
        )


def test_words_are_about_the_results_that_they_were_written_for():
    assert (
        "about results of the preset `laptop`"
        in check_claims({"more is less": lambda: False}, "smoke").data
    )


def test_words_may_be_about_other_things_than_a_preset():
    note = check_claims(
        {"less is more": lambda: False}, "seed 4", "seed 3", subject="the parameters"
    )
    assert note is not None
    assert (
        "about results of the parameters `seed 3`; these are of `seed 4`" in note.data
    )
