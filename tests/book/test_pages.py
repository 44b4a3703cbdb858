"""The rendered pages are complete, need no other host, and have correct links."""

import ast
import functools
import re
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import unquote, urldefrag

import pytest
import yaml
from pages import ABROAD, MODULES, ROOT, STYLE_ADDRESS, Page, contents, modules

EQUATIONS = {  # the paper's number -> the label, and the function that computes it
    1: ("prediction-loss", "sidm.learning.losses.prediction_loss"),
    2: ("discriminator-objective", "sidm.learning.losses.expected_discriminator_loss"),
    3: ("discriminator-loss", "sidm.learning.losses.discriminator_loss"),
    4: ("matching-objective", "sidm.learning.losses.expected_matching_loss"),
    5: ("matching-loss", "sidm.learning.losses.matching_loss"),
}


@functools.cache
def read(path: Path) -> Page:
    return Page(path)


def links(path: Path) -> set[str]:
    return {address for _, address in read(path).links}


def faults(page: Page) -> Iterator[str]:
    """What is wrong with a page, whichever it is."""
    yield from (f"fetches {address}" for address in page.abroad)
    yield from (f"no link: {name}" for name in page.unlinked)
    for image in page.images:
        alt = image.get("alt", "").strip()
        if len(alt) < 10 or alt.lower().endswith((".png", ".svg", ".jpg", ".gif")):
            yield f"a picture without words: {image.get('src', '')[-80:]}"
    if "traceback" in page.classes:
        yield "a traceback"
    text = page.path.read_text(encoding="utf-8")
    if "jupyter.widget-view+json" in text:
        yield "an empty widget"
    if "IPython.core.display" in re.sub("<[^>]*>", "", text):
        yield "something is not shown, but named"
    for tag, address in page.links + page.loads:
        place, mark = urldefrag(address)
        other = ABROAD.match(address) or ":" in place.split("/")[0]
        if other or place.startswith("?") or tag == "style":
            continue
        relative = unquote(place.split("?")[0])
        target = (page.path.parent / relative).resolve() if place else page.path
        if not target.is_file():
            yield f"a broken link: {address}"
        elif mark and target.suffix == ".html":
            if unquote(mark) not in read(target).names:
                yield f"a link to no place: {address}"


def test_every_page_is_whole(book):
    found = {
        str(path.relative_to(book)): [*faults(read(path))]
        for path in book.rglob("*.html")
        if "_static" not in path.relative_to(book).parts
    }
    assert {name: wrong for name, wrong in found.items() if wrong} == {}
    assert set(found) >= {f"{name}.html" for name in ("index", *contents())}


def test_no_style_sheet_fetches_from_another_host(book):
    sheets = {path: path.read_text(encoding="utf-8") for path in book.rglob("*.css")}
    assert [path for path, text in sheets.items() if STYLE_ADDRESS.search(text)] == []


def test_a_page_says_how_long_it_takes_to_read(book):
    """The first page and the book's first part take less than two hours."""
    toc = yaml.safe_load((ROOT / "_toc.yml").read_text())
    core = [toc["root"], *(one["file"] for one in toc["parts"][0]["chapters"])]
    note = re.compile(r'<p class="reading-time">(\d+) min to read</p>')
    times = [note.findall((book / f"{name}.html").read_text()) for name in core]
    assert [len(found) for found in times] == [1] * len(core)
    assert sum(int(found[0]) for found in times) < 120


def test_equations_carry_the_papers_numbers_and_lead_to_what_computes_them(book):
    paper = book / "book" / "paper.html"
    text = paper.read_text(encoding="utf-8")
    for number, (label, name) in EQUATIONS.items():
        after = text.partition(f'id="equation-{label}"')[2]
        assert f'<span class="eqno">({number})' in after[:200], label
        assert f"api/{name.rpartition('.')[0]}.html#{name}" in links(paper), name


def test_the_page_of_the_package_leads_to_every_room(book):
    addresses = {urldefrag(a)[0] for a in links(book / "book" / "extending.html")}
    text = (ROOT / "book" / "extending.md").read_text(encoding="utf-8")
    table = [line for line in text.splitlines() if line.startswith("| {py:mod}`")]
    name = re.compile(r"`((?:sidm|ownrobot|companion)\.[a-z][\w.]*)`")
    rooms = name.findall("\n".join(line.split("|")[1] for line in table))
    assert len(rooms) > 15
    assert {room for room in rooms if f"api/{room}.html" not in addresses} == set()


def test_modules_fill_the_sidebar_of_the_reference_alone(book):
    def listed(name: str) -> int:
        packages = "sidm.", "ownrobot.", "companion."
        addresses = links(book / f"{name}.html")
        return sum("api/" in one or one.startswith(packages) for one in addresses)

    assert listed("book/glossary") == 0
    pages = list((book / "book" / "api").glob("*.html"))
    assert listed(f"book/api/{MODULES[1]}") >= len(pages) > 50


def public_names(module: str, path: Path) -> set[str]:
    """Names of a module's functions, classes, methods and fields in the reference."""
    names = set()
    for node in ast.parse(path.read_text(encoding="utf-8")).body:
        if isinstance(node, (ast.FunctionDef, ast.ClassDef)):
            names.add(node.name)
        if isinstance(node, ast.ClassDef):
            fields = [
                n.target.id
                for n in node.body
                if isinstance(n, ast.AnnAssign) and isinstance(n.target, ast.Name)
            ]
            methods = [n.name for n in node.body if isinstance(n, ast.FunctionDef)]
            names |= {f"{node.name}.{name}" for name in fields + methods}
    return {
        f"{module}.{name}"
        for name in names
        if not any(part.startswith("_") for part in name.split("."))
    }


@pytest.mark.more  # with the whole reference
def test_every_module_and_every_public_name_is_in_the_reference(book):
    pages = {path.stem: path for path in (book / "book" / "api").glob("*.html")}
    assert set(pages) == set(modules())
    for name, path in modules().items():
        assert public_names(name, path) - read(pages[name]).names == set()


def test_fields_are_in_the_reference_with_the_texts_beside_them(book):
    pages = book / "book" / "api"
    text = (pages / "sidm.systems.html").read_text(encoding="utf-8")
    after = text.partition('id="sidm.systems.Physics.contact_stiffness"')[2]
    assert "30000.0" in after[:2000] and "of the terrain, N/m" in after[:2000]
    for path in pages.glob("*.html"):
        text = path.read_text(encoding="utf-8")
        assert "Alias for field number" not in text and '">Type<' not in text, path
