"""The README's numbers are those of the store."""

from pathlib import Path

import pytest

from sidm.book.headline import BEGIN, END, headline, refresh, stored
from sidm.experiments.engine.frame import frame_of

ROOT = Path(__file__).parents[2]


def test_the_readme_says_what_is_stored(monkeypatch):
    monkeypatch.chdir(ROOT)
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    assert refresh(text, *stored("no data")) == text, "out of date: make figures"


def test_only_the_block_between_the_marks_changes():
    text = f"before\n{BEGIN}\nold\n{END}\nafter"
    nothing = frame_of([])
    assert refresh(text, nothing, nothing) == f"before\n{headline(nothing, nothing)}\nafter"
    assert "No trials stored" in headline(nothing, nothing)


def test_a_readme_without_its_marks_is_refused():
    with pytest.raises(ValueError, match="headline: begin"):
        refresh("nothing here", frame_of([]), frame_of([]))
