"""The explorer as an app, served as by `make explore`."""

import socket
import subprocess
import sys
import time
import urllib.error
import urllib.request

import pytest
from pages import ROOT

pytestmark = pytest.mark.more

APP = "notebooks/22-explorer.ipynb"


@pytest.fixture(scope="module")
def address(project):
    """Address at which the app is served."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    arguments = (
        f"-m voila {APP} --no-browser --port={port} --Voila.ip=127.0.0.1".split()
    )
    with subprocess.Popen(
        [sys.executable, *arguments], cwd=project, stderr=subprocess.PIPE, text=True
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


def test_make_explore_serves_this_notebook():
    assert f"voila {APP} " in (ROOT / "Makefile").read_text()


def test_a_slider_of_the_app_simulates_anew(address, context):
    wait_for(address)
    page = context.browser.new_page()  # may connect to this machine alone
    page.route(lambda url: not url.startswith(address), lambda route: route.abort())
    page.goto(address, wait_until="domcontentloaded")
    picture = page.wait_for_selector("img.widget-image", timeout=120_000)
    assert "spring (N/m)" in page.inner_text("body")
    assert "Traceback" not in page.inner_text("body")
    before = picture.get_attribute("src")
    handle = page.locator(".noUi-handle").first
    handle.focus()
    handle.press("ArrowLeft")
    changed = "before => document.querySelector('img.widget-image').src !== before"
    page.wait_for_function(changed, arg=before, timeout=60_000)
    page.close()
