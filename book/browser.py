"""The browser that takes pictures of pages and opens them in tests."""

from __future__ import annotations

import shutil

BROWSERS = ("chromium", "chromium-browser", "google-chrome")


def chromium() -> str | None:
    """Path of the browser, or None if no browser is installed."""
    return next(filter(None, map(shutil.which, BROWSERS)), None)
