"""The rendered pages in a browser without a network.

They are tested in light and dark, in a window of a desk and of a phone.
"""

import functools
import gzip
import re
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest
from axe_playwright_python.sync_playwright import Axe
from browser import chromium
from pages import DESK, MODULES, contents, watched

from companion import Results, Study
from companion.explorer import grid
from companion.explorer.comparison import ROWS, robots_in_words, value_text
from companion.figures.style import system_label
from companion.statistics.stopping_rules import RULES
from companion.studies.decisive import verdicts
from companion.studies.decisive.length_curves import along_training
from ownrobot.comparison.statistics import Interval
from ownrobot.replay import ROBOTS

PHONE = {"width": 375, "height": 800}
EXPLORER = "notebooks/01-robots"
#: options of axe-core: fetch nothing, and describe only violations
AXE = {"preload": False, "resultTypes": ["violations"]}
COLOURS = "color-contrast"  # this rule takes most of the time
#: rule for tables and pictures that scroll in narrow windows
SCROLLING = "scrollable-region-focusable"
#: blocks of code that scroll can be reached with the keyboard
MARKED = """() => [...document.querySelectorAll("pre")].every(
    block => block.scrollWidth <= block.clientWidth || block.tabIndex === 0
)"""
#: addresses of pictures that are not there
MISSING = """() => [...document.images]
    .filter(image => !image.complete || !image.naturalWidth)
    .map(image => image.src)"""
FONTS = "async () => [...await document.fonts.ready].map(font => font.status)"
#: waits until the browser has drawn two frames
FRAMES = """() => new Promise(requestAnimationFrame).then(
    () => new Promise(requestAnimationFrame)
)"""
#: the first page, a chapter with a chart, and the explorer: looked at by `make test`
FIRST = ("book/intro", "notebooks/04-figure3", EXPLORER)
PAGES = [
    pytest.param(name, marks=() if name in FIRST else pytest.mark.more)
    for name in (*contents(), *(f"book/api/{module}" for module in MODULES))
]
PLAIN = """spans => {
    const seen = new Set();
    for (const span of spans) {
        const block = span.closest(".highlight").parentElement;
        const look = [span, span.parentElement, block, block.parentElement]
            .map(element => element.className).join();
        if (seen.has(look)) span.replaceWith(span.textContent);
        seen.add(look);
    }
}"""  # keeps only the first of the code tokens that look alike


@pytest.fixture
def visit(book, context):
    """Function that opens a page of the book; problems of the page fail the test."""
    page = context.new_page()
    page.loaded = set()  # addresses that were requested
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
    """Skip once for all tests that need a browser."""
    if chromium() is None:
        pytest.skip(
            "the pages are not tested: no Chromium found; "
            "install it (Debian's package 'chromium')"
        )


@pytest.mark.parametrize("name", PAGES)
def test_a_page_is_whole_and_has_no_barriers(visit, name):
    """Without a network, in a small and a large window, in light and in dark.

    It passes axe-core's rules; of tokens of code that look alike, only the first is
    tested for colours.
    """
    # opened in a small window: the theme follows a change of size only later
    page = visit(name, PHONE)
    page.evaluate(FRAMES)
    assert faults(page, PHONE) == []
    on_phone = barriers(page, {"runOnly": [SCROLLING]})
    page.set_viewport_size(DESK)
    assert faults(page, DESK) == []
    files = {
        Path(unquote(address.path))
        for address in page.loaded
        if address.scheme == "file"
    }
    weights = sorted((weight(file), file.name) for file in files)
    assert sum(map(weight, files)) <= 2e6, weights[-5:]
    # the theme marks scrolling blocks some time after the window has changed
    page.wait_for_function(MARKED)
    page.add_style_tag(content="* { transition: none !important }")
    on_desk = barriers(page, {"rules": {COLOURS: {"enabled": False}}})
    # blocks were marked for a width before the final one: test again
    if any("crollable region" in words for words in on_desk):
        page.wait_for_function(MARKED)
        on_desk = barriers(page, {"rules": {COLOURS: {"enabled": False}}})
    assert (on_phone, on_desk) == ([], [])
    page.eval_on_selector_all(".highlight span", PLAIN)
    for scheme in ("light", "dark"):
        page.emulate_media(color_scheme=scheme)
        page.wait_for_function(
            f"() => document.documentElement.dataset.theme === '{scheme}'"
        )
        assert barriers(page, {"runOnly": [COLOURS]}) == [], scheme


@pytest.mark.more
@pytest.mark.parametrize("name", ["search", "genindex"])
def test_a_list_is_whole_without_a_network(visit, name):
    assert faults(visit(name, PHONE), PHONE) == []


def faults(page, size) -> list[str]:
    """What is wrong with equations, pictures and width in a window of a size."""
    found = page.evaluate(MISSING)
    if page.evaluate("() => document.scrollingElement.scrollWidth") > size["width"]:
        found.append(f"wider than a window of {size['width']} pixels")
    formulas = page.locator(".math:not(.math .math)").count()
    if not formulas:
        return found
    page.evaluate("() => MathJax.startup.promise")
    if page.locator(".math mjx-container").count() < formulas:
        found.append("equations that are not drawn")
    if page.locator("mjx-merror, [data-mjx-error]").count():
        found.append("equations that MathJax cannot read")
    fonts = page.evaluate(FONTS)
    if "loaded" not in fonts or "error" in fonts:
        found.append("the fonts of the equations did not load")
    return found


@functools.cache
def weight(file: Path) -> int:
    """Bytes of a file as a reader receives it: hosts compress text."""
    content = file.read_bytes()
    compressed = file.suffix in {".html", ".css", ".js", ".svg"}
    return len(gzip.compress(content) if compressed else content)


@pytest.mark.more
def test_plots_are_stacked_on_a_phone(visit):
    page = visit("notebooks/07-rivals", PHONE)
    picture, parts = (
        page.locator(f"img:has(+ .stacked){end}").first for end in ("", " + .stacked")
    )
    assert not picture.is_visible() and parts.is_visible()
    for part in parts.locator("svg").all():
        box = part.bounding_box()
        assert 0 < box["width"] and box["x"] + box["width"] <= PHONE["width"]
    page.set_viewport_size(DESK)
    assert picture.is_visible() and not parts.is_visible()


@pytest.mark.more
def test_the_benchmark_sorts_and_leads_to_its_trials(visit):
    page = visit("book/benchmark-table", PHONE)
    assert page.evaluate("() => document.body.scrollWidth") <= PHONE["width"]
    first = page.locator("#methods tbody td:first-child")
    best = first.all_inner_texts()
    page.click("#methods th:has-text('method') button")
    assert first.all_inner_texts() == sorted(best) != best
    page.click("#groups >> text=struts held by motors")
    assert "system1, 5 min" in page.inner_text("#tasks thead")
    page.click("#tasks tr:has(button:text-is('trees')) td:nth-child(2) button")
    trials = [
        row.split("\t")[:2] for row in page.locator("#rows tbody tr").all_inner_texts()
    ]
    assert trials == 3 * [["trees", "system1, 1 min"]]
    for scheme in ("light", "dark"):
        page.emulate_media(color_scheme=scheme)
        assert barriers(page, {}) == []


def barriers(page, rules) -> list[str]:
    """Violations of some rules that axe-core finds, a line for each element."""
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
        ("least squares", "rivals"),
        ("Warthog", "when-it-pays"),
        ("p_e", "p-expert-and-phases"),
    ],
)
def test_a_search_finds_the_chapter_first(book, context, words, chapter):
    # not `visit`: for files the browser blocks texts of results, with console errors
    page = context.new_page()
    page.goto(f"{(book / 'search.html').as_uri()}?q={words}")
    page.wait_for_function(
        "() => document.querySelector('.search-summary')"
        "?.textContent.includes('finished')"
    )
    links = "all => all.map(a => a.getAttribute('href'))"
    links_found = page.eval_on_selector_all("#search-results ul.search > li > a", links)
    page.close()
    assert links_found and f"-{chapter}.html" in links_found[0], links_found


def pictures(page) -> list[str]:
    """Pictures that the explorer's charts show now."""
    return page.eval_on_selector_all(
        "#explorer canvas", "all => all.map(canvas => canvas.toDataURL())"
    )


def changed(page, act) -> str:
    """Do something to the explorer; what it says of both robots after that."""
    shown = page.get_attribute("#explorer", "data-shown")
    act()
    page.wait_for_function(
        "shown => document.getElementById('explorer').dataset.shown !== shown",
        arg=shown,
    )
    return page.locator(".explorer-words").inner_text()


def press(page, name: str) -> str:
    """Press one of the explorer's buttons; what it says of both robots after that."""
    button = page.locator(".explorer-controls").get_by_role("button", name=name)
    return changed(page, button.click)


@pytest.mark.parametrize(
    "size", [DESK, pytest.param(PHONE, marks=pytest.mark.more)], ids=["desk", "phone"]
)
def test_every_slider_changes_the_pictures(visit, size):
    """The keyboard alone moves every slider."""
    page = visit(EXPLORER)
    page.set_viewport_size(size)
    # with free struts, damping shows, too
    page.locator("#explorer-brakes").press("Space")
    sliders = page.locator("#explorer input[type=range]")
    assert sliders.count() >= 4
    for number in range(sliders.count()):
        slider = sliders.nth(number)
        before, words = pictures(page), slider.get_attribute("aria-valuetext")
        key = "ArrowRight" if slider.input_value() == "0" else "ArrowLeft"
        changed(page, functools.partial(slider.press, key))
        assert slider.get_attribute("aria-valuetext") != words
        assert all(
            now != other for now, other in zip(before, pictures(page), strict=True)
        ), slider.get_attribute("id")


@pytest.mark.more
def test_charts_keep_to_their_panels(visit):
    """Charts fit from a narrow window to a wide one and back."""
    page = visit(EXPLORER)
    fits = """() => [...document.querySelectorAll(".explorer-chart")].every(
        panel => panel.querySelector("canvas").clientWidth === panel.clientWidth)"""
    for size in (PHONE, DESK, PHONE):
        page.set_viewport_size(size)
        page.wait_for_function(fits)


def test_the_explorer_says_how_its_robots_differ(visit):
    """Words and numbers are those of the live explorer, whatever a button shows."""
    page = visit(EXPLORER)
    said = page.locator(".explorer-words").inner_text()
    assert said.startswith("System 1 novice beside its twin with 10,000 N/m: 5 times")
    assert "The gearing is the same." in said
    for words, names in grid.PAIRS.items():
        robots = [ROBOTS[name] for name in names]
        labels = [system_label(name) for name in names]
        assert press(page, words).startswith(robots_in_words(robots, labels))
        rows = page.locator("#explorer tbody tr").all_inner_texts()
        for row in ROWS:
            cells = [row.label, *(value_text(row, robot) for robot in robots)]
            assert "\t".join(cells) in rows
    assert page.get_by_role("button", name="system 2's pair", pressed=True).count() == 1
    said = press(page, "only the springs")
    assert "667 times the spring, the same damping, the same travel" in said
    assert "13 mm (−10 to 3)\t13 mm (−10 to 3)" in page.inner_text("#explorer table")


def test_a_ghost_leaves_the_sliders_alone_until_its_springs_are_taken(visit):
    page = visit(EXPLORER)
    before, spring = pictures(page), page.locator("#explorer-spring")
    ghost = page.locator("#explorer-robot")
    said = changed(page, lambda: ghost.select_option(label="system 2 expert"))
    assert "beside system 2 expert: 667 times the spring" in said
    assert spring.get_attribute("aria-valuetext") == "50,000 N/m"
    assert pictures(page) != before
    said = press(page, "take its springs, dampers and travel")
    assert "the same spring, the same damping, the same travel" in said
    assert spring.get_attribute("aria-valuetext") == "75 N/m"


@pytest.mark.more
def test_struts_at_a_stop_are_named(visit):
    """Soft struts that no motor holds meet their stops."""
    page = visit(EXPLORER)
    row = page.locator("#explorer tbody tr", has_text="time at a stop")
    assert "rear" not in row.inner_text(), "the motors hold the rear struts at 0 mm"
    press(page, "system 2's pair")
    changed(page, lambda: page.locator("#explorer-brakes").press("Space"))
    assert re.search(r"rear right \d+\s%.*front left \d+\s%", row.inner_text())


@pytest.mark.more
@pytest.mark.parametrize(("width", "scrolls"), [(PHONE["width"], False), (220, True)])
def test_a_table_that_scrolls_says_so(visit, width, scrolls):
    page = visit(EXPLORER, PHONE | {"width": width})
    page.evaluate(FRAMES)
    assert page.get_by_text("The table scrolls sideways.").is_visible() == scrolls


def test_figure_3_can_be_touched(visit):
    """The chart replaces its picture, and another pair of robots is another picture."""
    page = visit("notebooks/04-figure3")
    page.wait_for_selector(".vega-chart[data-drawn] canvas")
    assert page.locator(".vega-chart > img").count() == 0
    chart = page.locator(".vega-chart canvas")
    assert "novice data" in chart.get_attribute("aria-label")
    first = chart.evaluate("canvas => canvas.toDataURL()")
    page.get_by_label("system 2", exact=True).check()
    page.evaluate(FRAMES)
    assert chart.evaluate("canvas => canvas.toDataURL()") != first


@pytest.fixture
def stopping(visit):
    """Function that opens the page with the stopping point, at an address's state."""

    def open_page(state=""):
        page = visit("notebooks/04-figure3")
        if state:
            page.evaluate("state => (location.hash = state)", state)
        page.wait_for_selector(".stopping[data-shown]")
        page.evaluate(FRAMES)
        return page

    return open_page


def sentence(page) -> str:
    """What the page says about the stopping point."""
    return page.locator(".stopping-words").inner_text()


def spoken(row) -> str:
    """A ratio of a table of verdicts in the page's words."""
    value, ends = Interval(row.value, row.low, row.high).text(2).split(" ", 1)
    return f"{value} times {ends}"


@pytest.mark.more
def test_each_rule_gives_the_published_numbers(stopping):
    """The words at a button are the ratios of the verdicts and of the figure."""
    results = verdicts.results(Study("study"), Results("results"))
    table = along_training(results[results.system == "system1"])
    table = table[table.recipe == "R"]
    page = stopping()
    for rule in RULES:
        page.get_by_role("button", name=rule, exact=True).click()
        for minutes in (1, 5, 20):
            page.select_option("#stopping-minutes", f"{minutes}")
            rows = table[(table.rule == rule) & ~table.value.isna()]
            data = rows[rows.quantity == "data"]
            loss = rows[(rows.quantity == "loss") & (rows.minutes == minutes)]
            for row in (*data.itertuples(), *loss.itertuples()):
                assert spoken(row) in sentence(page), (rule, minutes)
    judged = verdicts.data_ratios(results)
    published = judged[(judged.verdict == "R1") & (judged.system == "system1")]
    page.get_by_role("button", name=verdicts.RELEASED, exact=True).click()
    assert spoken(published.iloc[0]) in sentence(page)


#: A finger comes down on a chart, moves down by so many pixels, and goes.
FINGER = """([x, y, down]) => {
    const place = document.querySelector(".stopping-saving");
    place.setPointerCapture = () => {};  // no such finger is on the screen
    const event = (name, y, buttons) => place.dispatchEvent(new PointerEvent(name, {
        pointerType: "touch", button: 0, buttons, clientX: x, clientY: y, bubbles: true,
    }));
    event("pointerdown", y, 1);
    event("pointermove", y + down, 1);
    event("pointerup", y + down, 0);
}"""


@pytest.mark.more
def test_the_stopping_point_moves_by_key_pointer_and_address(stopping):
    page = stopping("recipe=R-system1&minutes=5&stop=1500000")
    page.wait_for_function(
        "() => document.querySelector('.stopping').dataset.shown.includes('1.5 mill')"
    )
    page.locator("#stopping-stop").press("ArrowRight")
    assert "1.6 million" in sentence(page) and "stop=1600000" in page.url
    page.locator(".stopping-saving canvas").scroll_into_view_if_needed()
    box = page.locator(".stopping-saving canvas").bounding_box()
    middle = box["y"] + box["height"] / 2
    before = sentence(page)
    page.mouse.move(box["x"] + 0.5 * box["width"], middle)
    page.mouse.down()
    page.mouse.move(box["x"] + 0.95 * box["width"], middle, steps=4)
    page.mouse.up()
    assert sentence(page) != before and "million samples" in sentence(page)
    before, place = sentence(page), [box["x"] + 0.4 * box["width"], middle]
    page.evaluate(FINGER, [*place, 60])
    assert sentence(page) == before  # a finger that scrolls the page
    page.evaluate(FINGER, [*place, 0])
    assert sentence(page) != before  # a tap
    page.goto(page.url.partition("#")[0] + "#recipe=T-system1&stop=8000000")
    page.reload()
    page.locator("#stopping-stop").press("End")
    assert "the data of an SIDM with 5 minutes" in sentence(page)
    page.evaluate("() => (location.hash = '#a-section')")
    page.evaluate(FRAMES)
    assert page.url.endswith("#a-section")


@pytest.mark.more
def test_a_draw_of_the_search_is_drawn(stopping):
    """Choosing a draw, or pointing at its dot, changes the first chart."""
    page = stopping()
    picture = "() => document.querySelector('.stopping-losses canvas').toDataURL()"
    before = page.evaluate(picture)
    page.select_option("#stopping-draw", index=1)
    page.evaluate(FRAMES)
    chosen = page.evaluate(picture)
    assert chosen != before
    page.locator(".stopping-search canvas").scroll_into_view_if_needed()
    box = page.locator(".stopping-search canvas").bounding_box()
    draw = page.input_value("#stopping-draw")
    for share in (0.25, 0.3, 0.35, 0.4, 0.45, 0.5, 0.55, 0.6, 0.65, 0.7):
        for down in (0.35, 0.4, 0.45, 0.5, 0.55):
            page.mouse.move(
                box["x"] + share * box["width"], box["y"] + down * box["height"]
            )
    assert page.input_value("#stopping-draw") != draw
