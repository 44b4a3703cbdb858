"""The README's numbers are computed from the stored results."""

import re
from pathlib import Path

import pytest

from companion.__main__ import build_parser
from companion.pages.headline import (
    FIGURE,
    FIRST_PAGE,
    Stored,
    glued_numbers,
    headline_numbers,
    headlines,
    stored_results,
)

ROOT = Path(__file__).parents[2]


def bold_numbers() -> list[str]:
    """The numbers that the README has in bold, in their order."""
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    return re.findall(r"\*\*([\d.]+)\*\*", text)


def test_the_readme_says_what_is_stored(monkeypatch):
    monkeypatch.chdir(ROOT)
    numbers = headline_numbers(stored_results("no data"))
    assert bold_numbers() == numbers, "write its sentences anew"
    assert (ROOT / FIGURE).stat().st_size < 200_000


def test_another_store_would_have_other_numbers(monkeypatch):
    monkeypatch.chdir(ROOT)
    stored = stored_results("no data")

    def with_half(method):
        frame, little = (
            table.assign(
                validation_loss=table.validation_loss / (1 + (table.method == method))
            )
            for table in stored[:2]
        )
        return headline_numbers(stored._replace(frame=frame, little=little))

    usual = headline_numbers(stored)
    assert len(usual) == 15
    assert with_half("novice_only") != usual
    assert with_half("sidm") == usual, "they are of the decisive experiment"
    assert with_half("pretrain_finetune")[9:] != usual[9:]
    assert with_half("pretrain_finetune")[:9] == usual[:9]
    few = stored.decisive[stored.decisive.seed < 3]
    assert headline_numbers(stored._replace(decisive=few))[:3] != usual[:3]
    assert headline_numbers(Stored(*(table[:0] for table in stored))) == []


def test_every_number_has_its_rows_and_its_command(monkeypatch):
    monkeypatch.chdir(ROOT)
    rows = headlines(stored_results("no data"))
    assert [one.number for one in rows] == bold_numbers()
    assert all(one.rows > 10 for one in rows)
    assert len({one.quantity for one in rows}) == 15
    parser = build_parser()
    for command in {row.command for row in rows}:
        parser.parse_args(command.split()[1:])


def test_every_number_of_the_first_page_has_its_chapter_and_its_command(monkeypatch):
    monkeypatch.chdir(ROOT)
    text = FIRST_PAGE.read_text(encoding="utf-8")
    numbers = glued_numbers(text)
    assert len(numbers) == text.count("{glue:text}") > 0
    for number in numbers:
        assert re.match(r"(at least )?-?\d", number.number), number
        build_parser().parse_args(number.command.split()[1:])
    with pytest.raises(ValueError, match="04-figure3 glues no 'nothing'"):
        glued_numbers("{glue:text}`../notebooks/04-figure3.ipynb::nothing:s`")
