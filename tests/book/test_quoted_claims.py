"""The sentences that a reader would quote stand as they do, and the results say so."""

import contextlib
import json
import shutil
from pathlib import Path

import pytest
from changed import change
from claims import CLAIMS, FIRST_PAGE, Book
from pages import ROOT
from places import shared_by_workers

from sidm.storage import locked


@pytest.fixture(scope="module")
def stored() -> Book:
    return Book(ROOT / "results")


def words_of(page: str) -> str:
    """The prose of a page: its Markdown, with numbers where cells have shown them."""
    text = (ROOT / page).read_text(encoding="utf-8")
    if page.endswith(".ipynb"):
        parts = []
        for cell in json.loads(text)["cells"]:
            if cell["cell_type"] == "markdown":
                parts += [*cell["source"], "\n"]
            elif cell["source"][:1] == ["%%text\n"]:
                parts += cell["outputs"][0]["data"]["text/markdown"]
        text = "".join(parts)
    return " ".join(text.replace("*", "").split())


@pytest.mark.parametrize("claim", CLAIMS, ids=lambda one: f"{one.page}: {one.words}")
def test_a_claim_stands_on_its_page_and_the_results_bear_it_out(stored, claim):
    words = words_of(claim.page)
    assert claim.words.replace("*", "") in words, "the words are gone"
    assert claim.holds(stored), "the results say otherwise: write the page anew"


def test_the_first_page_has_claims_and_most_chapters():
    pages = [claim.page for claim in CLAIMS]
    assert pages.count(FIRST_PAGE) >= 4 and len(set(pages)) >= 13


@pytest.mark.more
def test_other_results_would_not_bear_the_claims_out(tmp_path_factory):
    """Most of them: some exchanged values agree with a sentence by chance."""
    folder = shared_by_workers(tmp_path_factory) / "changed"
    with locked(folder):
        shutil.rmtree(folder, ignore_errors=True)
        change(ROOT / "results", folder)
    other = Book(Path(folder))
    holding = []
    for claim in CLAIMS:
        # results that cannot be compared bear nothing out
        with contextlib.suppress(KeyError, IndexError, ValueError, AssertionError):
            holding += [claim.words] if claim.holds(other) else []
    assert len(holding) < len(CLAIMS) / 5, holding
