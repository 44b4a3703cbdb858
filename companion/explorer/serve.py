"""The live explorer as an app: `python -m companion.explorer.serve NOTEBOOK`.

Voila serves the notebook. Nothing is asked of another host, and its links to pages of
the book lead to the rendered book.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import tornado.web
from voila.app import Voila
from voila.tornado.handler import TornadoVoilaHandler

#: Voila's page loads a font of icons from another host; the explorer has none.
FOREIGN = re.compile(r'<link\b[^>]*\bhref="https?:[^>]*>')


class Notebook(TornadoVoilaHandler):
    """The notebook's page."""

    def write(self, chunk: Any) -> None:
        """Send a part of the page."""
        super().write(FOREIGN.sub("", chunk) if isinstance(chunk, str) else chunk)


class Book(tornado.web.StaticFileHandler):
    """The rendered book."""

    def write_error(self, status_code: int, **_: Any) -> None:
        """Say how a page that is not there is made."""
        self.finish("<p>The book is not rendered yet: <code>make book</code> does.</p>")


class App(Voila):
    """Voila with the rendered book beside its notebook."""

    def init_handlers(self) -> list:
        """Addresses and what answers there."""
        *others, (address, _, options) = super().init_handlers()
        project = Path(self.notebook_path).resolve().parents[1]
        book = [
            (
                r"/((?:book|notebooks)/.*)\.(?:md|ipynb)",
                tornado.web.RedirectHandler,
                {"url": "/_build/html/{0}.html", "permanent": False},
            ),
            (r"/(_build/html/.*)", Book, {"path": project}),
        ]
        return [*book, *others, (address, Notebook, options)]


if __name__ == "__main__":
    App.launch_instance()
