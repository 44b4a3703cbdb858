"""The rendered pages are complete, need no other host, and have correct links."""

import ast
import functools
import re
from pathlib import Path
from urllib.parse import unquote, urldefrag

import pytest
import yaml
from pages import ABROAD, ROOT, STYLE_ADDRESS, Page, contents

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


@pytest.fixture
def pages(book) -> list[Page]:
    return [
        read(path)
        for path in sorted(book.rglob("*.html"))
        if "_static" not in path.relative_to(book).parts
    ]


def test_the_expected_pages_exist(book):
    assert [
        name for name in ["index", *contents()] if not (book / f"{name}.html").is_file()
    ] == []


def test_no_page_fetches_from_another_host(pages):
    assert {str(page.path): page.abroad for page in pages if page.abroad} == {}


def core() -> list[str]:
    """The first page and those of the book's first part."""
    toc = yaml.safe_load((ROOT / "_toc.yml").read_text())
    return [toc["root"], *(one["file"] for one in toc["parts"][0]["chapters"])]


def test_a_page_says_how_long_it_takes_to_read(book):
    times = {
        name: re.findall(
            r'<p class="reading-time">(\d+) min to read</p>',
            (book / f"{name}.html").read_text(),
        )
        for name in core()
    }
    assert all(len(found) == 1 for found in times.values()), times
    assert sum(int(found[0]) for found in times.values()) < 120, (
        "the core takes less than two hours"
    )


def test_no_style_sheet_fetches_from_another_host(book):
    addresses_found = {
        str(path): STYLE_ADDRESS.findall(path.read_text(encoding="utf-8"))
        for path in book.rglob("*.css")
    }
    assert {
        path: addresses for path, addresses in addresses_found.items() if addresses
    } == {}


def test_links_inside_the_book_resolve(book, pages):
    broken = []
    for page in pages:
        for tag, address in page.links + page.loads:
            place, mark = urldefrag(address)
            if (
                ABROAD.match(address)
                or ":" in place.split("/")[0]
                or place.startswith("?")
                or tag == "style"
            ):
                continue
            relative = unquote(place.split("?")[0])
            target = (page.path.parent / relative).resolve() if place else page.path
            if not target.is_file():
                broken.append(f"{page.path.name}: {address}")
            elif (
                mark
                and target.suffix == ".html"
                and unquote(mark) not in read(target).names
            ):
                broken.append(f"{page.path.name}: {address} (no such place)")
    assert broken == []


def test_every_picture_has_words(pages):
    def wordless(image: dict[str, str]) -> bool:
        alt = image.get("alt", "").strip()
        return len(alt) < 10 or alt.lower().endswith(
            (".png", ".svg", ".jpg", ".jpeg", ".gif")
        )

    found = {
        str(page.path): [i.get("src", "")[-80:] for i in page.images if wordless(i)]
        for page in pages
    }
    assert {path: images for path, images in found.items() if images} == {}


def test_every_reference_to_the_package_is_a_link(pages):
    assert {str(page.path): page.unlinked for page in pages if page.unlinked} == {}


def test_equations_carry_the_papers_numbers(book):
    text = (book / "book" / "paper.html").read_text(encoding="utf-8")
    for number, (label, _) in EQUATIONS.items():
        _, found, after = text.partition(f'id="equation-{label}"')
        assert found, f"equation {label} is missing"
        assert f'<span class="eqno">({number})' in after[:200], (
            f"equation {label} is not ({number})"
        )


def test_equations_link_to_what_computes_them(book):
    links = {address for _, address in read(book / "book" / "paper.html").links}
    names = {name for _, name in EQUATIONS.values()}
    assert {
        name
        for name in names
        if f"api/{name.rpartition('.')[0]}.html#{name}" not in links
    } == set()


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


def modules() -> dict[str, Path]:
    """File of every module of the packages but their commands, by its name."""
    files = [
        path
        for name in ("sidm", "ownrobot", "companion")
        for path in (ROOT / name).rglob("*.py")
        if path.name != "__main__.py"
    ]
    names = [".".join(path.relative_to(ROOT).with_suffix("").parts) for path in files]
    names = [name.removesuffix(".__init__") for name in names]
    return dict(zip(names, files, strict=True))


def test_every_module_has_its_page_in_the_reference(book):
    assert {path.stem for path in (book / "book" / "api").glob("*.html")} == set(
        modules()
    )


def test_the_page_of_the_package_leads_to_every_room(book):
    links = {
        urldefrag(address)[0]
        for _, address in read(book / "book" / "extending.html").links
    }
    text = (ROOT / "book" / "extending.md").read_text(encoding="utf-8")
    table = [line for line in text.splitlines() if line.startswith("| {py:mod}`")]
    name = re.compile(r"`((?:sidm|ownrobot|companion)\.[a-z][\w.]*)`")
    rooms = name.findall("\n".join(line.split("|")[1] for line in table))
    assert len(rooms) > 15
    assert {room for room in rooms if f"api/{room}.html" not in links} == set()


def test_modules_fill_the_sidebar_of_the_reference_alone(book):
    def listed(name: str) -> int:
        return sum(
            "api/" in a or a.startswith(("sidm.", "ownrobot.", "companion."))
            for _, a in read(book / f"{name}.html").links
        )

    assert listed("book/glossary") == 0
    assert listed("book/api/sidm.systems") >= len(modules())


def test_every_public_name_is_in_the_reference(book):
    """Fields are in the reference, too, with the texts beside them."""
    pages = [read(path) for path in (book / "book" / "api").glob("*.html")]
    for name, path in modules().items():
        known = read(book / "book" / "api" / f"{name}.html").names
        assert public_names(name, path) - known == set()
    text = (book / "book" / "api" / "sidm.systems.html").read_text(encoding="utf-8")
    after = text.partition('id="sidm.systems.Physics.contact_stiffness"')[2]
    assert "30000.0" in after[:2000] and "of the terrain, N/m" in after[:2000]
    texts = {page.path.name: page.path.read_text(encoding="utf-8") for page in pages}
    assert [
        name
        for name, text in texts.items()
        if "Alias for field number" in text or '">Type<' in text
    ] == []


def test_no_page_shows_a_traceback_or_an_empty_widget(book, pages):
    assert [str(page.path) for page in pages if "traceback" in page.classes] == []
    words = {
        page.path: re.sub("<[^>]*>", "", page.path.read_text("utf-8")) for page in pages
    }
    assert [
        path for path, text in words.items() if "IPython.core.display" in text
    ] == [], "not shown, but named"
    widgets = [
        page.path
        for page in pages
        if "jupyter.widget-view+json" in page.path.read_text(encoding="utf-8")
    ]
    assert widgets == []
