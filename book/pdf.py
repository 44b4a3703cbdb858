"""Bind the core pages of the rendered book into one PDF.

Chromium prints the pages, and pypdf joins them.

Usage: python book/pdf.py _build/html _build/sidm-companion.pdf
"""

from __future__ import annotations

import io
import shutil
import sys
from pathlib import Path
from urllib.parse import unquote, urldefrag, urlparse

import yaml
from playwright.sync_api import Browser, Page, sync_playwright
from pypdf import PdfReader, PdfWriter
from pypdf.generic import ArrayObject, DictionaryObject, NameObject

BROWSERS = ("chromium", "chromium-browser", "google-chrome")
SHEET = {"format": "A4", "print_background": True}
MARGIN = {"top": "16mm", "bottom": "18mm", "left": "15mm", "right": "15mm"}
SCALE = 0.72  # of the printed size to the size on the screen
CONTENTS = Path(__file__).parents[1] / "_toc.yml"
CORE = Path(__file__).with_name("core.txt")  # names of the bound pages, one a line


def chromium() -> str | None:
    """Path of the browser, or None if no browser is installed."""
    return next(filter(None, map(shutil.which, BROWSERS)), None)


def chapters() -> list[tuple[str, list[str]]]:
    """Parts of the book, each with its caption and its core pages in reading order.

    Parts without a core page are left out.
    """
    toc = yaml.safe_load(CONTENTS.read_text(encoding="utf-8"))
    parts = [
        (part["caption"], [chapter["file"] for chapter in part["chapters"]])
        for part in toc["parts"]
    ]
    core = CORE.read_text(encoding="utf-8").split()
    chosen = [
        (name, [file for file in files if file in core])
        for name, files in (("Start", [toc["root"]]), *parts)
    ]
    return [(name, files) for name, files in chosen if files]


def prepare(browser: Browser, path: Path) -> Page:
    """Open a page for printing: equations and charts drawn, folded tables open."""
    # narrower than a sheet at SCALE, so that charts fit
    page = browser.new_page(viewport={"width": 860, "height": 1200})
    page.emulate_media(media="print", color_scheme="light")
    page.goto(path.resolve().as_uri(), wait_until="load")
    page.evaluate("() => window.MathJax?.startup?.promise")
    page.evaluate(
        "() => document.querySelectorAll('details')"
        ".forEach(folded => (folded.open = true))"
    )
    if page.locator("#explorer").count():
        page.wait_for_selector("#explorer[data-shown]")
    for chart in page.locator(".vega-chart").all():
        chart.locator("canvas").wait_for()
    return page


def print_page(browser: Browser, path: Path) -> PdfReader:
    """Print one page on as many sheets as it needs."""
    page = prepare(browser, path)
    printed = page.pdf(**SHEET, margin=MARGIN, scale=SCALE)
    page.close()
    return PdfReader(io.BytesIO(printed))


def numbers(browser: Browser, count: int) -> PdfReader:
    """Print `count` sheets that are empty but for their number."""
    style = """
        body { margin: 0 }
        div { position: relative; height: 296mm; break-after: page }
        p {
            position: absolute; bottom: 9mm; width: 100%;
            text-align: center; font: 9pt sans-serif; color: #444;
        }
    """
    sheets = "".join(f"<div><p>{n}</p></div>" for n in range(1, count + 1))
    page = browser.new_page()
    page.set_content(f"<style>{style}</style><body>{sheets}</body>")
    printed = page.pdf(**SHEET)
    page.close()
    return PdfReader(io.BytesIO(printed))


def bind_links(writer: PdfWriter, html: Path, starts: dict[str, int]) -> None:
    """Point links between pages of the book to the first sheet of each page.

    Other links to files of this machine are removed.

    Args:
        writer: with all sheets, changed in place.
        html: folder of the rendered book.
        starts: number of the first sheet of each page, by its name.
    """
    for sheet in writer.pages:
        kept = []
        for reference in sheet.get("/Annots", []):
            annotation = reference.get_object()
            address = str(annotation.get("/A", {}).get("/URI", ""))
            if address.startswith("file:"):
                path = Path(unquote(urlparse(urldefrag(address)[0]).path))
                inside = path.is_relative_to(html)
                name = str(path.relative_to(html).with_suffix("")) if inside else ""
                if name not in starts:
                    continue
                first = writer.pages[starts[name]].indirect_reference
                destination = ArrayObject([first, NameObject("/Fit")])
                annotation[NameObject("/A")] = DictionaryObject(
                    {
                        NameObject("/S"): NameObject("/GoTo"),
                        NameObject("/D"): destination,
                    }
                )
            kept.append(reference)
        if "/Annots" in sheet:
            sheet[NameObject("/Annots")] = ArrayObject(kept)


def make_pdf(
    browser: Browser, html: Path, parts: list[tuple[str, list[str]]], output: Path
) -> int:
    """Print and bind pages of the rendered book in `html`; return their sheets' count.

    `parts` has the caption and the names of the pages of each part.
    """
    html, writer, starts = html.resolve(), PdfWriter(), {}
    for caption, names in parts:
        part = None
        for name in names:
            printed = print_page(browser, html / f"{name}.html")
            starts[name] = len(writer.pages)
            writer.append(printed, import_outline=False)
            part = part or writer.add_outline_item(caption, starts[name])
            title = str((printed.metadata or {}).get("/Title", name)).split(" — ")[0]
            writer.add_outline_item(title, starts[name], parent=part)
    bind_links(writer, html, starts)
    numbered = numbers(browser, len(writer.pages)).pages
    for sheet, number in zip(writer.pages, numbered, strict=True):
        sheet.merge_page(number)
    writer.add_metadata({"/Title": "System invariant dynamics models: a companion"})
    output.parent.mkdir(parents=True, exist_ok=True)
    writer.write(output)
    return len(writer.pages)


def main(html: Path, output: Path) -> None:
    """Bind the core pages of the rendered book in `html` into the file `output`."""
    path = chromium()
    if path is None:
        raise SystemExit(
            "make pdf needs Chromium: "
            "install it, for example Debian's package 'chromium'"
        )
    with sync_playwright() as play:
        browser = play.chromium.launch(executable_path=path)
        print(f"{output}: {make_pdf(browser, html, chapters(), output)} sheets")
        browser.close()


if __name__ == "__main__":
    if len(sys.argv) != 3:
        raise SystemExit(__doc__)
    main(*map(Path, sys.argv[1:]))
