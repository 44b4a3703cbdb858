"""The README's numbers are those of the store."""

from pathlib import Path

from sidm.book.headline import FIGURE, numbers, stated, stored

ROOT = Path(__file__).parents[2]


def test_the_readme_says_what_is_stored(monkeypatch):
    monkeypatch.chdir(ROOT)
    frame, little, _ = stored("no data")
    assert stated((ROOT / "README.md").read_text(encoding="utf-8")) == numbers(frame, little), (
        "write its sentences anew"
    )
    assert (ROOT / FIGURE).stat().st_size < 200_000


def test_another_store_would_have_other_numbers(monkeypatch):
    monkeypatch.chdir(ROOT)
    frame, little, _ = stored("no data")
    loss = frame.validation_loss
    better = frame.assign(validation_loss=loss.where(frame.method != "sidm", loss / 2))
    usual = numbers(frame, little)
    assert numbers(better, little)[:6] != usual[:6] and len(usual) == 11
    assert numbers(frame, little.assign(validation_loss=little.validation_loss / 2))[6:9] != usual[6:9]
    assert numbers(frame[:0], little[:0]) == []
