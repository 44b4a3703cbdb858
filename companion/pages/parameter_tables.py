"""Tables of every parameter: of each chapter, and of the presets."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import nbformat
import yaml

from companion.pages.markdown import markdown_table
from companion.pages.notebook import find_notebook, notebooks, project_root
from companion.pages.parameters import inspect
from companion.presets import PRESETS, Preset
from companion.study import Study
from sidm.systems import PAPER_SYSTEMS

HEAD = ("parameter", "type", "value", "what it is")


def chapters_text(chapters: Sequence[str] = ()) -> str:
    """A table of the parameters of each notebook, or of those that are named."""
    parts = []
    for path in [find_notebook(name) for name in chapters] or notebooks():
        lines = [
            (f"`{p.name}`", f"`{p.kind_text}`", f"`{p.default}`", p.help)
            for p in inspect(path).values()
        ]
        first_cell = nbformat.read(path, as_version=4).cells[0].source
        heading = first_cell.splitlines()[0].lstrip("# ")
        title = f"**[{heading}]({path.name})**, `{path.stem}`"
        parts.append(f"{title}\n\n{markdown_table(HEAD, lines)}")
    return "\n\n".join(parts)


def presets_text() -> str:
    """A table of the presets' main sizes, and one of what files of `params/` set."""
    return f"{_sizes()}\n\n{_files()}"


def _sizes() -> str:
    """A column for each preset."""

    def line(name: str, text: Callable[[Preset], object]) -> tuple[str, ...]:
        return name, *(str(text(preset)) for preset in PRESETS.values())

    def minutes(sizes: Sequence[float]) -> str:
        return ", ".join(f"{size:g}" for size in sizes)

    def trials(preset: Preset) -> int:
        study = Study(preset)
        return sum(len(study.figure3(system)) for system in PAPER_SYSTEMS)

    lines = [
        line(
            "novice data, system 1 (min)", lambda p: minutes(p.novice_minutes_system1)
        ),
        line(
            "novice data, system 2 (min)", lambda p: minutes(p.novice_minutes_system2)
        ),
        line("expert data (min)", lambda p: f"{p.expert_minutes:.3g}"),
        line("validation data (min)", lambda p: f"{p.validation_minutes:g}"),
        line("trials a point", lambda p: p.seeds),
        line(
            "more of them",
            lambda p: "; ".join(f"{n} with {size:g} min" for size, n in p.more_seeds),
        ),
        line("trials of Figure 3", trials),
        line("height map (pixels a side)", lambda p: p.network.pixels),
        line(
            "LSTM (layers x size)", lambda p: f"{p.network.layers} x {p.network.hidden}"
        ),
        line("samples a trial, at most", lambda p: f"{p.training.max_samples:,}"),
        line("patience (samples)", lambda p: f"{p.training.patience:,}"),
    ]
    return markdown_table(["", *(f"`{name}`" for name in PRESETS)], lines)


def _files() -> str:
    """A column for each file; a row for each name that a chapter knows."""
    files = sorted(project_root().glob("params/*.yaml"))
    values = {path.stem: yaml.safe_load(path.read_text()) for path in files}
    known = {name for path in notebooks() for name in inspect(path)}
    names = sorted(known & {name for given in values.values() for name in given})
    lines = [
        (f"`{name}`", *(f"`{v[name]}`" if name in v else "" for v in values.values()))
        for name in names
    ]
    return markdown_table(["parameter", *(f"`{name}.yaml`" for name in values)], lines)
