"""How long the two explorers take to show what a slider was moved to, in wall-clock time.

The page without a kernel is measured in headless Chromium, from the book in `_build/html` or the folder that is named.
"""

from __future__ import annotations

import shutil
import sys
import time
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from sidm.explorer import explorer
from sidm.explorer.live import helper

CHANGES = 20

# From a key's press until the charts have it and the browser has painted them.
MOVE = """async () => {
  const slider = document.querySelector("#explorer input[type=range]"), root = document.getElementById("explorer");
  const times = [];
  for (let change = 0; change < %d; change += 1) {
    const shown = root.dataset.shown, start = performance.now();
    slider.value = Number(slider.value) > 0 ? 0 : Number(slider.max);
    slider.dispatchEvent(new Event("input", { bubbles: true }));
    while (root.dataset.shown === shown) await new Promise(requestAnimationFrame);
    times.push(performance.now() - start);
  }
  return times;
}"""


def report(what: str, milliseconds: Iterable[float]) -> None:
    """Print the median with the least and the most."""
    times = np.array(list(milliseconds))
    print(f"{what:40s} {np.median(times):7.0f} ms [{times.min():.0f}, {times.max():.0f}]", flush=True)


def live() -> Iterable[float]:
    """Changes of the spring, each to a value not seen before."""
    box = explorer()
    spring = next(knob for knob in box.children[0].children if knob.description.startswith("spring"))
    helper()[1].result()  # it simulates the second robot from now on
    for value in np.geomspace(100, 40_000, CHANGES):
        start = time.perf_counter()
        spring.value = value
        yield 1e3 * (time.perf_counter() - start)


def static(book: Path) -> list[float]:
    """Changes of the first slider from one end to the other."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as play:
        browser = play.chromium.launch(executable_path=shutil.which("chromium"))
        page = browser.new_page(viewport={"width": 1280, "height": 900})
        page.goto((book / "book" / "explorer.html").absolute().as_uri())
        page.wait_for_function("() => document.getElementById('explorer').dataset.shown")
        times = page.evaluate(MOVE % CHANGES)
        browser.close()
    return times


if __name__ == "__main__":
    report("with a kernel: both robots simulated", live())
    rendered = Path(sys.argv[1] if len(sys.argv) > 1 else "_build/html")
    if (rendered / "book" / "explorer.html").is_file():
        report("without: the page", static(rendered))
    else:
        print(f"{rendered} has no book; 'make book' renders it, and the page without a kernel can be measured")
