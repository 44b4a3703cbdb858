"""Tables of every parameter: of each chapter, and of the presets."""

from __future__ import annotations

from collections.abc import Sequence

import nbformat
import pandas as pd
import yaml

from companion.figures.style import system_label
from companion.pages.markdown import markdown_table, table_markdown
from companion.pages.notebook import find_notebook, notebooks, project_root
from companion.pages.parameters import inspect
from companion.presets import PRESETS, Preset
from sidm.systems import PAPER_SYSTEMS


def chapters_text(chapters: Sequence[str] = ()) -> str:
    """A table of the parameters of each notebook, or of those that are named."""
    parts = []
    for path in [find_notebook(name) for name in chapters] or notebooks():
        lines = [
            (f"`{p.name}`", f"`{p.annotation}`", f"`{p.default}`", p.help)
            for p in inspect(path).values()
        ]
        first_cell = nbformat.read(path, as_version=4).cells[0].source
        heading = first_cell.splitlines()[0].lstrip("# ")
        title = f"**[{heading}]({path.name})**, `{path.stem}`"
        table = markdown_table(("parameter", "type", "value", "what it is"), lines)
        parts.append(f"{title}\n\n{table}")
    return "\n\n".join(parts)


def presets_text() -> str:
    """A table of the presets' main sizes, and one of what files of `params/` set."""
    columns = {f"`{name}`": _sizes(preset) for name, preset in PRESETS.items()}
    sizes = pd.DataFrame(columns, dtype=object).rename_axis("preset").reset_index()
    files = sorted(project_root().glob("params/*.yaml"))
    values = {path.stem: yaml.safe_load(path.read_text()) for path in files}
    known = {name for path in notebooks() for name in inspect(path)}
    names = sorted(known & {name for given in values.values() for name in given})
    lines = [
        (f"`{name}`", *(f"`{v[name]}`" if name in v else "" for v in values.values()))
        for name in names
    ]
    head = ["parameter", *(f"`{name}.yaml`" for name in values)]
    return f"{table_markdown(sizes)}\n\n{markdown_table(head, lines)}"


def _sizes(preset: Preset) -> dict[str, object]:
    """Sizes of a preset by their name on a page."""
    novice, p_expert = {}, {}
    for name in PAPER_SYSTEMS:
        minutes = ", ".join(f"{minutes:g}" for minutes in preset.novice_minutes(name))
        novice[f"novice data, {system_label(name)} (min)"] = minutes
        p_expert[f"$p_e$, {system_label(name)}"] = preset.p_expert(name)
    return {
        "expert data (min)": f"{preset.expert_minutes:.0f}",
        **novice,
        **p_expert,
        "validation data (min)": f"{preset.validation_minutes:g}",
        "trials a point": preset.seeds,
        "trials with 1 and 5 min": preset.seeds_at(5),
        "height map (pixels a side)": preset.network.pixels,
        "LSTM layers": f"{preset.network.layers} x {preset.network.hidden}",
        "initial weights": preset.network.initialisation,
        "samples a trial, at most": f"{preset.training.max_samples:,}",
    }
