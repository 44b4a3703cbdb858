"""The replay in a browser with WebGL in software and without a network.

The robots move, and they move as stored.
"""

import numpy as np
import pytest
from browser import chromium
from pages import DESK, watched
from playwright.sync_api import sync_playwright
from test_browser import PHONE

from companion.explorer import grid
from ownrobot.replay import ROBOTS, replay, ride
from ownrobot.replay.rides import SAMPLE_TIME
from sidm.systems import Terrain
from tests.companion.explorer.test_explorer import stored_rides

pytestmark = pytest.mark.more

WEBGL = ("--use-angle=swiftshader", "--enable-unsafe-swiftshader")
VIEW = "document.querySelector('.replay').replay"
PICTURE = f"""() => {{
    const view = {VIEW};
    view.draw();
    return view.renderer.domElement.toDataURL();
}}"""
SHOWN = "() => document.getElementById('explorer').dataset.shown"
PLACES = f"""time => {{
    const view = {VIEW};
    view.seek(time);
    view.draw();
    return view.robots.map(({{ body }}) => [
        ...body.getWorldPosition(new THREE.Vector3()),
        ...body.getWorldQuaternion(new THREE.Quaternion()),
    ]);
}}"""


@pytest.fixture(scope="module")
def browser():
    """A browser without a network, with WebGL on the processor."""
    with sync_playwright() as play:
        nowhere = "--host-resolver-rules=MAP * ~NOTFOUND"
        made = play.chromium.launch(executable_path=chromium(), args=[nowhere, *WEBGL])
        yield made
        made.close()


@pytest.fixture
def context(browser):
    """A browser window.

    The fixture has the name by which tests that need a browser are left out.
    """
    made = browser.new_context(offline=True, viewport=DESK)
    yield made
    made.close()


@pytest.fixture
def visit(book, context):
    """Function that opens a page; problems of the page fail the test."""
    problems = []

    def open_page(address=None, wait="#explorer[data-shown]", **options):
        page = context.new_page()
        page.emulate_media(**options)
        problems.append(watched(page))
        page.goto(address or (book / "notebooks" / "01-robots.html").as_uri())
        page.wait_for_selector(wait, state="attached")
        return page

    yield open_page
    assert not any(problems), problems


def change(page, act) -> None:
    """Do something to the controls, and wait until the page shows the change."""
    before = page.evaluate(SHOWN)
    act()
    page.wait_for_function(f"() => ({SHOWN})() !== {before!r}")


def pause(page) -> None:
    page.evaluate(f"() => {VIEW}.play(false)")


def test_frames_differ_while_it_plays_and_not_while_it_is_paused(visit):
    page = visit()
    assert page.get_attribute("#replay", "data-playing") == "true"
    frames, seconds = [], 0.0  # before 0.2 s the robots have hardly moved
    for _ in range(3):
        later = f"time => Math.abs({VIEW}.time - time) > 0.2 && {VIEW}.time > 0.2"
        page.wait_for_function(later, arg=seconds)
        frames.append(page.evaluate(PICTURE))
        seconds = page.evaluate(f"() => {VIEW}.time")
    assert len(set(frames)) == 3
    page.get_by_role("button", name="Pause").click()
    still = page.evaluate(PICTURE)
    page.wait_for_timeout(400)
    assert page.evaluate(PICTURE) == still
    assert page.get_by_role("button", name="Play").is_visible()


def test_the_robots_stand_where_the_stored_rides_say(visit):
    """At three times, both robots are at their stored places: twins, and a pair."""
    page, (set_ups, robots) = visit(), stored_rides()
    pause(page)
    spring, *others = [knob.values.index(knob.start) for knob in grid.KNOBS]
    rest, drive = others[: len(grid.SET_UP) - 1], others[len(grid.SET_UP) - 1 :]
    twins = [set_ups[(at, *rest, 0, *drive)] for at in (spring, spring - 1)]
    pair = [robots[(number, 0, *drive)] for number in (0, 1)]
    for rides, press in ((twins, None), (pair, "system 1's pair")):
        if press:
            change(page, page.get_by_role("button", name=press).click)
        for moment in (0, 31, 80):
            values = page.evaluate(PLACES, SAMPLE_TIME * moment)
            for place, numbers in zip(
                values, (one[moment] for one in rides), strict=True
            ):
                assert place[:3] == pytest.approx(numbers[:3] / 500, abs=1e-5)
                assert place[3:6] == pytest.approx(numbers[3:6] / 2000, abs=1e-3)
    assert np.hypot(*(np.array(values[0]) - values[1])[:2]) > 0.3, (
        "novice and expert go apart"
    )


def test_wheels_turn_and_kingpins_steer(visit):
    page = visit()
    change(page, lambda: page.locator("#explorer-weaves").check())
    pause(page)
    angles = f"""time => {{
        const view = {VIEW};
        view.seek(time);
        view.draw();
        return view.robots[0].moving.map(
            ([part]) => 2 * Math.acos(Math.min(1, Math.abs(part.quaternion.w)))
        );
    }}"""
    first, later = page.evaluate(angles, 0.5), page.evaluate(angles, 0.6)
    parts = page.evaluate(f"() => {VIEW}.robots[0].track.skeleton.parts")
    joints = [part["joint"] for part in parts if "joint" in part]
    moved = {
        joint: abs(a - b) for joint, a, b in zip(joints, first, later, strict=True)
    }
    assert all(moved[wheel] > 0.1 for wheel in range(4, 8))
    # at a quarter of the bend to the right
    assert first[joints.index(8)] == pytest.approx(0.3, abs=0.03)


def test_a_slider_changes_the_ride_while_it_plays(visit):
    page = visit()
    way = f"() => [...{VIEW}.robots[0].track.position]"
    before = page.evaluate(way)
    change(page, lambda: page.locator("#explorer-spring").press("ArrowLeft"))
    assert (
        page.evaluate(way) != before
        and page.get_attribute("#replay", "data-playing") == "true"
    )
    ground = f"() => {VIEW}.ground.heights.slice(0, 50)"
    heights = page.evaluate(ground)
    change(page, lambda: page.locator("#explorer-roughness").press("ArrowRight"))
    assert page.evaluate(ground) != heights


def test_throttle_and_weaving_exclude_each_other(visit):
    page = visit()
    change(page, lambda: page.locator("#explorer-throttle").press("ArrowRight"))
    change(page, lambda: page.locator("#explorer-weaves").check())
    throttle = page.locator("#explorer-throttle").get_attribute("aria-valuetext")
    assert throttle.startswith("0.5 ")
    change(page, lambda: page.locator("#explorer-throttle").press("ArrowRight"))
    assert not page.locator("#explorer-weaves").is_checked()


def test_the_ghost_appears_and_stands_beside(visit):
    page = visit()
    pause(page)
    page.evaluate(f"() => {VIEW}.seek(2)")
    pictures = {}
    for words in ("in one picture", "side by side", "the first alone"):
        page.get_by_label("both robots", exact=True).select_option(label=words)
        pictures[words] = page.evaluate(PICTURE)
    assert len(set(pictures.values())) == 3
    opacity = f"() => {VIEW}.robots.map(({{ materials }}) => materials.body.opacity)"
    first, second = page.evaluate(opacity)
    assert first == 1 and 0.2 < second < 0.7
    names = page.locator(".replay-names li").all_inner_texts()
    assert names[1].startswith("its twin with 10,000 N/m")
    assert "m from the first" in page.locator(".replay-names li").nth(1).inner_text()


def test_it_goes_by_the_keyboard(visit):
    page = visit()
    screen = page.locator(".replay-screen")
    screen.press("Space")
    assert page.get_attribute("#replay", "data-playing") == "false"
    # Space may have stopped the replay before its first frame: Home would do nothing
    page.evaluate(f"() => {VIEW}.seek(1)")
    camera = f"""() => {{
        const {{ camera, time, follow, speed }} = {VIEW};
        return {{ ...camera, time, follow, speed }};
    }}"""
    for key, name in {
        "Home": "time",
        "ArrowLeft": "azimuth",
        "ArrowUp": "elevation",
        "+": "distance",
        ".": "time",
        "f": "follow",
        "[": "speed",
    }.items():
        before = page.evaluate(camera)
        screen.press(key)
        assert page.evaluate(camera)[name] != before[name], key
    assert page.evaluate(camera)["time"] == pytest.approx(0.05)


def test_the_charts_and_the_replay_have_one_time(visit):
    page = visit()
    pause(page)
    line = page.locator(".explorer-cursor").first
    page.evaluate(f"() => {VIEW}.seek(1)")
    early = line.bounding_box()["x"]
    chart = page.locator(".explorer-chart").first
    chart.scroll_into_view_if_needed()
    box = chart.bounding_box()
    page.mouse.click(box["x"] + 0.8 * box["width"], box["y"] + 90)
    time = page.evaluate(f"() => {VIEW}.time")
    now = line.bounding_box()["x"]
    assert time > 2
    assert now > early + 50
    assert now == pytest.approx(box["x"] + 0.8 * box["width"], abs=2)


def test_memory_does_not_grow_over_many_rides(visit):
    """Memory of graphics and of scripts stays the same.

    three.js counts the objects in graphics memory; scripts are measured after garbage
    collection.
    """
    page = visit()
    pause(page)
    session = page.context.new_cdp_session(page)
    held = f"""() => {{
        const {{ memory, programs }} = {VIEW}.renderer.info;
        return {{ ...memory, programs: programs.length }};
    }}"""

    def heap():
        session.send("HeapProfiler.collectGarbage")
        return session.send("Runtime.getHeapUsage")["usedSize"]

    def swing(times):
        for number in range(times):
            key = "ArrowLeft" if number % 2 == 0 else "ArrowRight"
            change(page, lambda key=key: page.locator("#explorer-spring").press(key))

    swing(10)
    page.evaluate(PICTURE)
    before, used = page.evaluate(held), heap()
    swing(50)
    page.evaluate(PICTURE)
    assert page.evaluate(held) == before
    assert heap() < used + 3e6


def test_it_stands_still_where_less_motion_is_wanted(visit):
    page = visit(reduced_motion="reduce")
    page.wait_for_timeout(300)
    assert page.evaluate(f"() => [{VIEW}.playing, {VIEW}.time]") == [False, 0]


@pytest.mark.parametrize("size", [DESK, PHONE], ids=["desk", "phone"])
def test_it_follows_the_theme_and_the_window(visit, size):
    page = visit(color_scheme="light")
    page.set_viewport_size(size)
    pause(page)
    colours = f"""() => {{
        const {{ scene, renderer }} = {VIEW};
        return [scene.background.getHex(), renderer.domElement.clientWidth];
    }}"""
    light, width = page.evaluate(colours)
    page.emulate_media(color_scheme="dark")
    page.wait_for_function(
        f"light => {VIEW}.scene.background.getHex() !== light", arg=light
    )
    screen = page.locator(".replay-screen").evaluate("screen => screen.clientWidth")
    assert width == screen <= size["width"]


def test_without_webgl_the_film_stands_there(browser, book):
    page = browser.new_context(offline=True).new_page()
    page.add_init_script(
        "HTMLCanvasElement.prototype.getContext = (get => function (kind, ...rest) {"
        "return kind.startsWith('webgl') ? null : get.call(this, kind, ...rest); })"
        "(HTMLCanvasElement.prototype.getContext)"
    )
    page.goto((book / "notebooks" / "01-robots.html").as_uri())
    page.wait_for_selector("#explorer[data-shown]")
    assert "WebGL" in page.locator("#replay").inner_text()
    film = page.locator("#replay img")
    decoded = "async film => (await film.decode(), film.naturalWidth)"
    assert film.evaluate(decoded) > 300
    # the charts still work
    change(page, lambda: page.locator("#explorer-spring").press("ArrowLeft"))
    page.context.close()


def test_predictions_are_ghosts(visit, book):
    page = visit(
        (book / "notebooks" / "06-figure4.html").as_uri(), "#replay[data-shown]"
    )
    assert page.evaluate(
        f"() => {VIEW}.robots.map(({{ track }}) => track.ghost > 0)"
    ) == [False, True, True]
    page.locator(".replay-choice").select_option(value="scene-warthog")
    page.wait_for_selector("#replay[data-shown=scene-warthog]")
    assert page.locator(".replay-names li").first.inner_text().startswith("the Warthog")


def test_a_page_of_its_own_plays(visit, tmp_path):
    """The page that `ownrobot replay` writes plays, also in a frame of a notebook."""
    simulated = ride(
        ROBOTS["system1 novice"], Terrain(cell_height_scale=0.35), 3, 0.5, steps=5
    )
    view = replay(simulated)
    view.write(tmp_path / "page.html")
    page = visit((tmp_path / "page.html").as_uri(), "body[data-shown]")
    pause(page)
    assert page.evaluate(PLACES, 0.5)[0][:3] == pytest.approx(
        simulated.states[-1, :3].tolist(), abs=1e-3
    )
    (tmp_path / "notebook.html").write_text(view._repr_html_())
    page = visit((tmp_path / "notebook.html").as_uri(), "iframe")
    page.frame_locator("iframe").locator("body[data-shown] canvas").wait_for()
