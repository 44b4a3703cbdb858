"""Read rendered pages without a browser."""

import json
import re
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import yaml

ROOT = Path(__file__).parents[2]
#: modules whose pages are looked at; those of all other modules look like these
MODULES = ("sidm.learning", "sidm.systems", "sidm.learning.losses")
#: a name of the packages that a page refers to
ROLE = re.compile(r"\{py:\w+\}`~?(?:[^`<]*<)?([\w.]+)>?`")
DESK = {"width": 1280, "height": 900}  # size of a window, px

#: attributes whose addresses a browser fetches by itself, but that of a link to follow
LOADED = ("src", "srcset", "poster", "data", "href")
#: values of `rel` of <link> whose addresses a browser does not fetch
NOT_FETCHED = {"next", "prev", "canonical", "search", "index", "author"}
ABROAD = re.compile(r"^\s*(https?:)?//", re.IGNORECASE)
STYLE_ADDRESS = re.compile(
    r"(?:url\(|@import)\s*[\"']?\s*((?:https?:)?//[^\"')\s]+)", re.IGNORECASE
)


def contents() -> list[str]:
    """Names of the pages of the table of contents, without suffix, in reading order."""
    toc = yaml.safe_load((ROOT / "_toc.yml").read_text())
    return [
        toc["root"],
        *(chapter["file"] for part in toc["parts"] for chapter in part["chapters"]),
    ]


def source(name: str) -> str:
    """Prose of a page of the table of contents."""
    path = ROOT / f"{name}.md"
    if path.is_file():
        return path.read_text(encoding="utf-8")
    cells = json.loads((ROOT / f"{name}.ipynb").read_text(encoding="utf-8"))["cells"]
    return "\n\n".join(
        "".join(cell["source"])
        for cell in cells
        if cell["cell_type"] == "markdown" or cell["source"][:1] == ["%%text\n"]
    )


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


def named_modules() -> dict[str, list[str]]:
    """The modules that pages name, or whose names they name, with their packages.

    Each has the names of those directly below it.
    """
    known, found = modules(), set(MODULES)
    for name in contents():
        for target in ROLE.findall(source(name)):
            rooms = [one for one in known if f"{target}.".startswith(f"{one}.")]
            found.add(max(rooms, key=len))
    parts = [name.split(".") for name in found]
    chosen = {".".join(words[: n + 1]) for words in parts for n in range(len(words))}
    split = sorted(name.rpartition(".") for name in chosen)
    return {one: [name for room, _, name in split if room == one] for one in chosen}


def watched(page: Any) -> list[str]:
    """List that collects the problems of a browser's page from now on.

    Problems are errors, requests that fail and requests to another host.
    """
    problems: list[str] = []
    page.on("requestfailed", lambda request: problems.append(f"failed: {request.url}"))

    def on_request(request: Any) -> None:
        if not request.url.startswith(("file:", "data:", "blob:")):
            problems.append(request.url)

    def on_console(message: Any) -> None:
        if message.type == "error":
            problems.append(message.text)

    page.on("request", on_request)
    page.on("console", on_console)
    page.on("pageerror", lambda error: problems.append(str(error)))
    return problems


class Page(HTMLParser):
    """What one page contains.

    `loads` and `links` have pairs (tag, address), `names` has ids, `images` and
    `unlinked` have pictures and references without a link.
    """

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.path = path
        self.loads: list[tuple[str, str]] = []
        self.links: list[tuple[str, str]] = []
        self.names: set[str] = set()
        self.images: list[dict[str, str]] = []
        self.classes: set[str] = set()
        self.unlinked: list[str] = []
        self._inside: list[str] = []  # open <a>, <article>
        self._reference = False
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        values = {name: value or "" for name, value in attrs}
        classes = set(values.get("class", "").split())
        self.classes |= classes
        self.names |= {values[key] for key in ("id", "name") if values.get(key)}
        plain = set(values.get("rel", "").lower().split()) & NOT_FETCHED
        if tag != "a" and not (tag == "link" and plain):
            self.loads += [(tag, values[key]) for key in LOADED if values.get(key)]
        self._read_style(tag, values.get("style", ""))
        if tag == "a" and "href" in values:
            self.links.append((tag, values["href"]))
        if tag in ("a", "article"):
            self._inside.append(tag)
        if tag == "img" and "article" in self._inside:
            self.images.append(values)
        code = tag == "code" and {"xref", "py"} <= classes
        self._reference = code and "a" not in self._inside

    def handle_endtag(self, tag: str) -> None:
        if tag in self._inside:
            del self._inside[len(self._inside) - 1 - self._inside[::-1].index(tag)]

    def handle_data(self, data: str) -> None:
        if self._reference and data.strip():
            self.unlinked.append(data)
        self._reference = self._reference and not data.strip()
        if self.lasttag == "style":
            self._read_style("style", data)

    def _read_style(self, tag: str, style: str) -> None:
        self.loads += [(tag, address) for address in STYLE_ADDRESS.findall(style)]

    @property
    def abroad(self) -> list[str]:
        """Addresses on another host that the page would fetch."""
        return [
            f"<{t}> {address}" for t, address in self.loads if ABROAD.match(address)
        ]
