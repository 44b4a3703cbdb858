"""The book as a PDF: its pages, outline and links."""

import unicodedata

import pdf
import pytest
from pages import contents
from pypdf import PdfReader

pytestmark = pytest.mark.more


@pytest.fixture(scope="module")
def bound(book, context, tmp_path_factory) -> PdfReader:
    """The core of the book as a PDF."""
    path = tmp_path_factory.mktemp("pdf") / "book.pdf"
    assert pdf.make_pdf(context.browser, book, pdf.chapters(), path) == len(
        PdfReader(path).pages
    )
    return PdfReader(path)


def plain(text: str) -> str:
    """Text without ligatures and line breaks."""
    return " ".join(unicodedata.normalize("NFKC", text).split())


def test_the_pdf_has_the_core_of_the_book():
    bound = [name for _, names in pdf.chapters() for name in names]
    assert bound == pdf.CORE.read_text().split() and set(bound) < set(contents())


def test_its_outline_has_parts_and_chapters_where_they_begin(bound):
    parts = [item for item in bound.outline if not isinstance(item, list)]
    chapters = [
        item for items in bound.outline if isinstance(items, list) for item in items
    ]
    assert [item.title for item in parts] == [caption for caption, _ in pdf.chapters()]
    assert len(chapters) == len(pdf.CORE.read_text().split())
    for item in chapters:
        first = bound.pages[bound.get_destination_page_number(item)].extract_text()
        assert plain(item.title) in plain(first)


def test_it_has_at_most_85_sheets(bound):
    assert len(bound.pages) <= 85


def test_its_sheets_are_numbered(bound):
    for number, sheet in enumerate(bound.pages, 1):
        assert sheet.extract_text().rstrip().endswith(str(number))


def test_its_links_stay_in_the_book_or_lead_to_the_web(bound):
    actions = [
        note.get_object().get("/A", {})
        for sheet in bound.pages
        for note in sheet.get("/Annots", [])
    ]
    addresses = [str(action["/URI"]) for action in actions if "/URI" in action]
    assert all(address.startswith("http") for address in addresses)
    sheets = [sheet.indirect_reference for sheet in bound.pages]
    inside = [
        action["/D"][0]
        for action in actions
        if action.get("/S") == "/GoTo" and isinstance(action["/D"], list)
    ]
    assert inside and all(target in sheets for target in inside)


def test_what_is_folded_is_printed_whole(book, context):
    page = pdf.prepare(context.browser, book / "notebooks" / "04-figure3.html")
    assert page.locator("details[open] table").count() > 0
    assert page.evaluate("() => document.getAnimations().length") == 0, (
        "still fading in"
    )
    page.close()


def test_its_figures_are_in_it(bound):
    assert sum(len(sheet.images) for sheet in bound.pages) > 0
