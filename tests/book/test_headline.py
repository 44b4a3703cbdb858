"""The README's numbers are those of the store."""

from pathlib import Path

from companion.__main__ import build_parser
from companion.methods import FOR_LITTLE
from companion.pages.headline import FIGURE, headlines, numbers, stated, stored

ROOT = Path(__file__).parents[2]


def test_the_readme_says_what_is_stored(monkeypatch):
    monkeypatch.chdir(ROOT)
    frame, little, _ = stored("no data")
    assert stated((ROOT / "README.md").read_text(encoding="utf-8")) == numbers(
        frame, little
    ), "write its sentences anew"
    assert (ROOT / FIGURE).stat().st_size < 200_000


def test_another_store_would_have_other_numbers(monkeypatch):
    monkeypatch.chdir(ROOT)
    frame, little, _ = stored("no data")

    def with_half(method):
        both = ((some, 1 + (some.method == method)) for some in (frame, little))
        return numbers(
            *(
                some.assign(validation_loss=some.validation_loss / parts)
                for some, parts in both
            )
        )

    usual = numbers(frame, little)
    assert (
        len(usual) == 14
        and with_half("sidm")[:6] != usual[:6]
        and with_half("sidm")[6:] == usual[6:]
    )
    assert (
        with_half("sidm" + FOR_LITTLE)[6:12] != usual[6:12]
        and with_half("sidm" + FOR_LITTLE)[:6] == usual[:6]
    )
    assert numbers(frame[:0], little[:0]) == []


def test_every_number_has_its_rows_and_its_command(monkeypatch):
    monkeypatch.chdir(ROOT)
    frame, little, _ = stored("no data")
    found = headlines(frame, little)
    assert [one.number for one in found] == stated(
        (ROOT / "README.md").read_text(encoding="utf-8")
    )
    assert (
        all(one.rows > 10 for one in found) and len({one.words for one in found}) == 14
    )
    parser = build_parser()
    for command in {one.command for one in found}:
        parser.parse_args(command.split()[1:])
