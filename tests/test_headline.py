"""The README's numbers are those of the store."""

from pathlib import Path

import pytest

from sidm.book.headline import BEGIN, END, headline, refresh, stored_rows

ROOT = Path(__file__).parents[1]


def test_the_readme_says_what_is_stored(monkeypatch):
    monkeypatch.chdir(ROOT)
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    assert refresh(text, *stored_rows("no data")) == text, "out of date: make figures"


def test_only_the_block_between_the_marks_changes():
    text = f"before\n{BEGIN}\nold\n{END}\nafter"
    assert refresh(text, []) == f"before\n{headline([])}\nafter"
    assert "No trials stored" in headline([])


def test_a_readme_without_its_marks_is_refused():
    with pytest.raises(ValueError, match="headline: begin"):
        refresh("nothing here", [])
