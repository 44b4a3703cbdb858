"""What a notebook says of its own run: what it was run with, numbers in its text."""

from __future__ import annotations

import functools
import json
import re
import shlex
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from IPython.core.formatters import format_display_data
from IPython.core.getipython import get_ipython
from IPython.display import Markdown, display

from companion.pages.markdown import made_here
from companion.pages.notebook import enter_project, find_notebook, project_root
from companion.pages.parameters import inspect, refuse_out_of_range
from companion.registry import find_figure
from sidm.config import conform

#: `{name}` in the text of a page, or such braces in an equation, a role, a directive.
_NUMBER = re.compile(r"(?<![\w$\\}^])(`?)\{([\w.:-]+)\}(`?)")
#: a command in a line of provenance
_AGAIN = re.compile(r"again: (?:`|<code>)(.*?)(?:`|</code>)")
#: Parameters that decide where and how a page works, not what it shows.
_HOW = ("run_missing", "workers", "data")
#: prefix of the MIME types of an output that the notebook itself does not show
HIDDEN = "application/papermill.record/"


def glue(name: str, value: Any) -> None:
    """Store `value` under a name in the notebook's outputs, without showing it.

    MyST-NB's function `glue` does the same, but takes a second to import.
    """
    formats, metadata = format_display_data(value)
    display(
        {f"{HIDDEN}{mime_type}": data for mime_type, data in formats.items()},
        metadata={**metadata, "scrapbook": {"mime_prefix": HIDDEN, "name": name}},
        raw=True,
    )


def glued(notebook: Path, name: str) -> tuple[str, str]:
    """The text that a stored notebook glued under a name, and what makes it again.

    That is the last command in the next line of provenance, '' where none follows.
    ValueError says that the notebook has no such name.
    """
    text = None
    for output in _outputs(notebook):
        data = output.get("data", {})
        if output.get("metadata", {}).get("scrapbook", {}).get("name") == name:
            text = "".join(data[f"{HIDDEN}text/plain"]).strip("'")
        commands = _AGAIN.findall(json.dumps(data))
        if text is not None and commands:
            return text, commands[-1]
    if text is None:
        raise ValueError(f"{notebook.name} glues no '{name}'")
    return text, ""


@functools.cache
def _outputs(notebook: Path) -> tuple[dict[str, Any], ...]:
    """The outputs of a stored notebook in their order, read once in a process."""
    cells = json.loads(notebook.read_text(encoding="utf-8"))["cells"]
    return tuple(output for cell in cells for output in cell.get("outputs", ()))


class Page:
    """A notebook that is being run; made in the cell after its parameters.

    The project's folder becomes the working folder. Where a parameter has another value
    than in the project's notebook, the page begins with a line that says so; a value of
    another type or outside its range raises ConfigError. The cell magic `%%text` shows
    Markdown in which `{name}` stands for a number, see `fill`. The notebook has the
    `name`, such as '04-figure3', and the variables `values`, its `globals()`.
    """

    def __init__(self, name: str, values: Mapping[str, Any]) -> None:
        enter_project()
        self.name, self._values = name, values
        self._numbers: dict[str, str] = {}
        path = project_root() / "notebooks" / f"{name}.ipynb"
        parameters = inspect(path)
        for parameter in parameters.values():
            value = conform(values[parameter.name], parameter.kind, parameter.name)
            refuse_out_of_range(value, parameter)
        #: parameter -> its value, where it is not the notebook's own
        self.changed = {
            key: values[key]
            for key, parameter in parameters.items()
            if not _same(values[key], parameter.value)
        }
        if shell := get_ipython():
            register = shell.register_magic_function
            register(self._text, "cell", "text")  # type: ignore[arg-type]  # is bound
        if told := {k: v for k, v in self.changed.items() if k not in _HOW}:
            display(Markdown(_banner(told)))

    def glue(self, name: str, value: Any) -> None:
        """Keep a number for the text of this page and of others."""
        self._numbers[name] = str(value)
        glue(name, value)

    def fill(self, text: str) -> str:
        """A text in which each `{name}` is the number of that name; else NameError.

        It is one that this page glued, a variable of the notebook, or, as
        `{04-figure3::tuned-saving}`, one that another page's stored run glued.
        """

        def number(found: re.Match) -> str:
            before, name, after = found.groups()
            if before != after:  # {role}`...` or ```{directive}
                return found[0]
            return before + self._number(name) + after

        return _NUMBER.sub(number, text)

    def _number(self, name: str) -> str:
        chapter, _, key = name.rpartition("::")
        if chapter:
            return glued(find_notebook(chapter), key)[0]
        value = self._numbers.get(name, self._values.get(name))
        if value is None:
            raise NameError(f"the text has '{{{name}}}', and there is no such number")
        return f"{value:g}" if isinstance(value, float) else str(value)

    def _text(self, _: str, text: str) -> None:
        display(Markdown(self.fill(text)))

    def command(self, output: str = "mine.ipynb", **others: Any) -> str:
        """The command that runs this page again as it was run, but for `others`."""
        words = ["companion", "notebook", self.name, output]
        for name, value in (self.changed | others).items():
            words += ["-p", name, _as_yaml(value)]
        return shlex.join(words)

    def made_here(self, kind: str = "training") -> Markdown:
        """Provenance of what this page has simulated or computed itself."""
        return Markdown(made_here(self.command(f"_build/{self.name}.ipynb"), kind))

    def again(self, figure: str, preset: str | None = None, *more: str) -> str:
        """The command that runs the trials of a figure which this page shows.

        The preset is by default the page's parameter; `more` are further arguments.
        """
        chosen = str(preset or self._values.get("preset", "laptop"))
        words = ["companion", "run", "--preset", chosen, "--figure", figure, *more]
        systems = self._values.get("systems", [self.changed.get("system")])
        found = find_figure(figure)
        known = found.pairs if found else systems
        single = len(systems) == 1 and systems[0] and systems[0] in known
        if single and "--system" not in more:
            words += ["--system", systems[0]]
        return shlex.join([*words, *self.folders()])

    def folders(self) -> list[str]:
        """The arguments of a command for the folders that the page ran with."""
        changed = [name for name in ("results", "data") if name in self.changed]
        return [w for name in changed for w in (f"--{name}", str(self.changed[name]))]


def _same(value: Any, default: Any) -> bool:
    """Whether two values of a parameter are one; texts may name one folder."""
    if isinstance(value, str) and isinstance(default, str) and default:
        return value == default or Path(value).absolute() == Path(default).absolute()
    return bool(value == default)


def _banner(changed: Mapping[str, Any]) -> str:
    values = ", ".join(f"`{k} = {_as_yaml(v)}`" for k, v in changed.items())
    return (
        f"> **Run with {values}.** Numbers, tables and figures are of this run. "
        "The words around them speak of the study that the repository stores."
    )


def _as_yaml(value: Any) -> str:
    """A value as `companion notebook -p` takes it."""
    return value if isinstance(value, str) else json.dumps(value)
