"""The explorer as an app, served as by `make explore`."""

import socket
import subprocess
import sys
import time
import urllib.error
import urllib.request

import pytest
from pages import DESK, ROOT

pytestmark = pytest.mark.more

APP = "notebooks/17-explorer.ipynb"
SERVER = "companion.explorer.serve"
PICTURE = "img[alt^='Height of the body']"


@pytest.fixture(scope="module")
def address(project):
    """Address at which the app is served."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    arguments = f"-m {SERVER} {APP} --no-browser --port={port} --Voila.ip=127.0.0.1"
    with subprocess.Popen(
        [sys.executable, *arguments.split()],
        cwd=project,
        stderr=subprocess.PIPE,
        text=True,
    ) as server:
        yield f"http://127.0.0.1:{port}/"
        server.terminate()
        server.communicate()


def wait_for(address: str) -> None:
    """Wait until the server answers."""
    for _ in range(600):
        try:
            urllib.request.urlopen(f"{address}voila/static/voila.js").close()
            return
        except urllib.error.HTTPError:
            return
        except urllib.error.URLError:
            time.sleep(0.2)
    raise AssertionError("the server does not answer")


@pytest.fixture
def app(address, context):
    """The app in a browser; a request to another host fails the test."""
    wait_for(address)
    page = context.browser.new_page(viewport=DESK)  # may connect to this machine alone
    foreign = []

    def refuse(route):
        foreign.append(route.request.url)
        route.abort()

    page.route(lambda url: not url.startswith((address, "data:", "blob:")), refuse)
    page.goto(address, wait_until="domcontentloaded")
    page.wait_for_selector(PICTURE, timeout=120_000)
    yield page
    page.close()
    assert foreign == []


def test_make_explore_serves_this_notebook():
    assert f"-m {SERVER} {APP} " in (ROOT / "Makefile").read_text()


def test_a_slider_of_the_app_simulates_anew(app):
    assert "spring (N/m)" in app.inner_text("body")
    assert "Traceback" not in app.inner_text("body")
    before = app.locator(PICTURE).get_attribute("src")
    handle = app.locator(".noUi-handle").first
    handle.focus()
    handle.press("ArrowLeft")
    changed = f"before => document.querySelector({PICTURE!r}).src !== before"
    app.wait_for_function(changed, arg=before, timeout=60_000)


def test_labels_of_the_app_are_whole(app):
    labels = app.locator(".widget-label, .jupyter-button, select")
    cut = """all => all.filter(label => label.scrollWidth > label.clientWidth + 1)
        .map(label => label.textContent)"""
    for width in (DESK["width"], 400):
        app.set_viewport_size({"width": width, "height": 800})
        assert labels.count() > 10 and labels.evaluate_all(cut) == []


def test_robots_that_drive_come_into_view(app):
    app.get_by_role("button", name="see them drive").click()
    seen = """() => {
        const frame = document.querySelector("iframe")?.getBoundingClientRect();
        return frame && frame.top >= 0 && frame.bottom <= innerHeight + 1;
    }"""
    app.wait_for_function(seen, timeout=60_000)


def test_the_link_of_the_app_leads_to_the_rendered_page(app, project):
    link = app.locator("a[href*='01-robots']")
    page = project / "_build" / "html" / "notebooks" / "01-robots.html"
    address = app.url
    link.click()
    assert "make book" in app.inner_text("body"), "nothing is rendered yet"
    page.parent.mkdir(parents=True)
    page.write_text("<h1>rendered</h1>")
    app.goto(address)
    link.click()
    assert app.inner_text("h1") == "rendered"
    assert app.url.endswith("notebooks/01-robots.html")
