"""Tables of the page on Figure 3: losses and savings."""

from __future__ import annotations

from collections.abc import Sequence

import pandas as pd

from companion.figures.style import METHOD_STYLES, system_label
from companion.statistics.savings import ratio_texts
from companion.statistics.tables import loss_summary, wide

POINT = ["system", "novice_minutes", "method"]


def losses(frame: pd.DataFrame, systems: Sequence[str]) -> pd.DataFrame:
    """Losses as texts, mean (smallest, largest): a row a size, a column a method."""
    means = loss_summary(frame, POINT)
    columns = means[["mean", "minimum", "maximum"]].itertuples(index=False)
    texts = ["{:.3f} ({:.2f}, {:.2f})".format(*line) for line in columns]
    return _by_method(means.assign(text=texts), systems)


def savings(table: pd.DataFrame, systems: Sequence[str]) -> pd.DataFrame:
    """A table of `statistics.savings` as texts: a row a size, a column a method."""
    return _by_method(table.assign(text=ratio_texts(table)), systems)


def _by_method(table: pd.DataFrame, systems: Sequence[str]) -> pd.DataFrame:
    """The texts of a table by pair and size, a column a method; both in their order."""
    place = {name: number for number, name in enumerate([*systems, *METHOD_STYLES])}
    ordered = table.sort_values(
        POINT, key=lambda column: column.map(lambda value: place.get(value, value))
    )
    shown = ordered.assign(
        method=ordered.method.map(lambda name: METHOD_STYLES[name]["label"]),
        pair=ordered.system.map(system_label),
    )
    shown = shown.rename(columns={"novice_minutes": "novice data (min)"})
    return wide(shown, ["pair", "novice data (min)"], "method", "text")
