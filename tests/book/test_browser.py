"""The rendered pages in a browser with the network cut: light and dark, on a desk and
on a phone."""

import functools
import gzip
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest
from axe_playwright_python.sync_playwright import Axe
from pages import DESK, contents, watched
from pdf import chromium

PHONE = {"width": 375, "height": 800}
EXPLORER = "book/explorer"
#: nothing is fetched, and what passes is not described
AXE = {"preload": False, "resultTypes": ["violations"]}
COLOURS = "color-contrast"  # the rule that takes most of the time
#: what narrow windows make of tables and pictures
SCROLLING = "scrollable-region-focusable"
MARKED = "() => [...document.querySelectorAll('pre')].every(p => p.scrollWidth <= p.clientWidth || p.tabIndex === 0)"
#: two are drawn
FRAMES = "() => new Promise(requestAnimationFrame).then(() => new Promise(requestAnimationFrame))"
#: others look as these
MODULES = [
    f"book/api/sidm.{name}" for name in ("learning", "systems", "learning.losses")
]
PLAIN = """spans => {
    const seen = new Set();
    for (const span of spans) {
        const block = span.closest(".highlight").parentElement;
        const look = [span, span.parentElement, block, block.parentElement].map(one => one.className).join();
        if (seen.has(look)) span.replaceWith(span.textContent);
        seen.add(look);
    }
}"""  # of the tokens of code that look alike leaves the first


@pytest.fixture
def visit(book, context):
    """Opens a page of the book; nothing may go wrong with it until the end of the
    test."""
    page = context.new_page()
    page.loaded = set()  # addresses
    page.on(
        "request",
        lambda request: page.loaded.add(
            urlsplit(request.url)._replace(query="", fragment="")
        ),
    )
    problems = watched(page)

    def open_page(name, size=DESK):
        page.set_viewport_size(size)
        page.goto((book / f"{name}.html").as_uri(), wait_until="load")
        if name == EXPLORER:
            page.wait_for_selector("#explorer[data-shown]")
        return page

    yield open_page
    page.close()
    assert problems == []


def test_a_browser_is_there():
    """For all tests that need one, which are left out without."""
    if chromium() is None:
        pytest.skip(
            "the pages are not tested: no Chromium found; install it (Debian's package 'chromium')"
        )


@pytest.mark.parametrize("name", [*contents(), *MODULES, "search", "genindex"])
def test_a_page_is_whole_without_a_network(visit, name):
    page = visit(name)
    formulas = page.locator(".math:not(.math .math)").count()
    if formulas:
        page.evaluate("() => MathJax.startup.promise")
        assert page.locator(".math mjx-container").count() >= formulas, (
            "equations that are not drawn"
        )
        assert page.locator("mjx-merror, [data-mjx-error]").count() == 0, (
            "equations that MathJax cannot read"
        )
        fonts = page.evaluate(
            "async () => [...await document.fonts.ready].map(font => font.status)"
        )
        assert "loaded" in fonts and "error" not in fonts, (
            "the fonts of the equations did not load"
        )
    for size in (DESK, PHONE):
        page.set_viewport_size(size)
        missing = "() => [...document.images].filter(i => !i.complete || !i.naturalWidth).map(i => i.src)"
        assert page.evaluate(missing) == []
        width = page.evaluate("() => document.scrollingElement.scrollWidth")
        assert width <= size["width"], f"wider than a window of {size['width']} pixels"
    files = {
        Path(unquote(address.path))
        for address in page.loaded
        if address.scheme == "file"
    }
    assert sum(map(weight, files)) <= 2e6, sorted(
        (weight(file), file.name) for file in files
    )[-5:]


@functools.cache
def weight(file: Path) -> int:
    """Bytes of a file on their way to a reader: hosts send text compressed."""
    content = file.read_bytes()
    return len(
        gzip.compress(content)
        if file.suffix in {".html", ".css", ".js", ".svg"}
        else content
    )


@pytest.mark.parametrize("name", [*contents(), *MODULES])
def test_a_page_has_no_serious_barriers(visit, name):
    """By axe-core's rules; colours in light and in dark, of tokens that look alike the
    first."""
    # opened there, for the theme takes a while to follow a window
    page = visit(name, PHONE)
    page.evaluate(FRAMES)
    found = [
        f"on a phone: {words}" for words in barriers(page, {"runOnly": [SCROLLING]})
    ]
    page.set_viewport_size(DESK)
    # the theme marks what scrolls a while after the window's change
    page.wait_for_function(MARKED)
    page.add_style_tag(content="* { transition: none !important }")
    own = barriers(page, {"rules": {COLOURS: {"enabled": False}}})
    # marked for a width on the way to this one: it is done anew
    if any("crollable region" in words for words in own):
        page.wait_for_function(MARKED)
        own = barriers(page, {"rules": {COLOURS: {"enabled": False}}})
    found += own
    page.eval_on_selector_all(".highlight span", PLAIN)
    for scheme in ("light", "dark"):
        page.emulate_media(color_scheme=scheme)
        page.wait_for_function(
            f"() => document.documentElement.dataset.theme === '{scheme}'"
        )
        found += [
            f"{scheme}: {words}" for words in barriers(page, {"runOnly": [COLOURS]})
        ]
    assert found == []


def barriers(page, rules) -> list[str]:
    """What axe-core finds by some rules, a line an element."""
    violations = Axe().run(page, options=AXE | rules).response["violations"]
    grave = [rule for rule in violations if rule["impact"] in ("serious", "critical")]
    return [
        f"{rule['help']}: {node['html'][:200]}"
        for rule in grave
        for node in rule["nodes"]
    ]


@pytest.mark.parametrize(
    ("words", "chapter"),
    [
        ("least squares", "least-squares"),
        ("Warthog", "when-it-pays"),
        ("p_e", "ablation-p-expert"),
    ],
)
def test_a_search_finds_the_chapter_first(book, context, words, chapter):
    # a browser refuses a file's scripts the texts below the titles, in its console
    page = context.new_page()
    page.goto(f"{(book / 'search.html').as_uri()}?q={words}")
    page.wait_for_function(
        "() => document.querySelector('.search-summary')?.textContent.includes('finished')"
    )
    links = "all => all.map(a => a.getAttribute('href'))"
    found = page.eval_on_selector_all("#search-results ul.search > li > a", links)
    page.close()
    assert found and f"-{chapter}.html" in found[0], found


def pictures(page) -> list[str]:
    """What the explorer's charts show now."""
    return page.eval_on_selector_all(
        "#explorer canvas", "all => all.map(canvas => canvas.toDataURL())"
    )


@pytest.mark.parametrize("size", [DESK, PHONE], ids=["desk", "phone"])
def test_every_slider_changes_the_pictures(visit, size):
    """By the keyboard alone."""
    page = visit(EXPLORER)
    page.set_viewport_size(size)
    # free struts: damping, too, is seen
    page.locator("#explorer-brakes").press("Space")
    sliders = page.locator("#explorer input[type=range]")
    assert sliders.count() >= 4
    for number in range(sliders.count()):
        slider = sliders.nth(number)
        before, words = pictures(page), slider.get_attribute("aria-valuetext")
        shown = page.get_attribute("#explorer", "data-shown")
        slider.press("ArrowLeft")
        page.wait_for_function(
            f"() => document.getElementById('explorer').dataset.shown !== '{shown}'"
        )
        assert slider.get_attribute("aria-valuetext") != words
        assert all(
            one != other for one, other in zip(before, pictures(page), strict=True)
        ), slider.get_attribute("id")


def test_charts_keep_to_their_panels(visit):
    """From a narrow window to a wide one and back."""
    page = visit(EXPLORER)
    fits = """() => [...document.querySelectorAll(".explorer-chart")].every(
        panel => panel.querySelector("canvas").clientWidth === panel.clientWidth)"""
    for size in (PHONE, DESK, PHONE):
        page.set_viewport_size(size)
        page.wait_for_function(fits)


def test_choosing_a_robot_sets_the_sliders_and_draws_both(visit):
    page = visit(EXPLORER)
    before = pictures(page)
    page.select_option("#explorer-robot", label="system2 expert")
    page.wait_for_function(
        "() => document.getElementById('explorer').dataset.shown.endsWith('-3')"
    )
    assert page.locator("#explorer-spring").get_attribute("aria-valuetext") == "75 N/m"
    assert (
        "system2 expert" in page.locator("#explorer table").inner_text()
        and pictures(page) != before
    )


def test_figure_3_can_be_touched(visit):
    """Another pair of robots is another picture; the first page has the chart, drawn in
    place of its picture."""
    page = visit("book/intro")
    page.wait_for_selector(".vega-chart[data-drawn] canvas")
    assert page.locator(".vega-chart > img").count() == 0
    assert "novice data" in page.locator(".vega-chart canvas").get_attribute(
        "aria-label"
    )
    first = page.evaluate(
        "() => document.querySelector('.vega-chart canvas').toDataURL()"
    )
    page.get_by_label("system 2", exact=True).check()
    page.evaluate(FRAMES)
    assert (
        page.evaluate("() => document.querySelector('.vega-chart canvas').toDataURL()")
        != first
    )
