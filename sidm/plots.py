"""The style of all figures, plots side by side, and what every plot ends with.

`pyplot`, the slow part of Matplotlib, is imported when something is drawn.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

STYLE = Path(__file__).with_suffix(".mplstyle")


def styled(draw: Callable[..., Figure]) -> Callable[..., Figure]:
    """Draw in the book's style, and leave no figure open behind."""

    @functools.wraps(draw)
    def drawn(*arguments: Any, **named: Any) -> Figure:
        import matplotlib.pyplot as plt

        with plt.style.context(STYLE):
            figure = draw(*arguments, **named)
        plt.close(figure)
        return figure

    return drawn


def side_by_side(count: int, columns: int = 0) -> tuple[Figure, list[Axes]]:
    """`count` plots in one row, or in rows of so many `columns`."""
    import matplotlib.pyplot as plt

    columns = columns or count
    rows = -(-count // columns)
    size = (1 + 4.2 * columns, 3.8 * rows)
    figure, axes = plt.subplots(
        rows, columns, figsize=size, squeeze=False, layout="constrained"
    )
    return figure, list(axes.flat)


#: Decades that a log axis may show -> its ticks in each.
TICKS: dict[float, tuple[float, ...]] = {
    0.6: (1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0),
    1.0: (1.0, 1.5, 2.0, 3.0, 5.0, 7.0),
    2.0: (1.0, 2.0, 5.0),
    np.inf: (1.0,),
}


def finish(axes: Axes, minutes: Iterable[float] = (), legend: bool = True) -> None:
    """A legend where something is drawn, a notice where not; log axes in plain numbers, at the `minutes` if given."""
    from matplotlib.ticker import FormatStrFormatter, LogLocator

    if not axes.has_data():
        axes.text(
            0.5,
            0.5,
            "no trials stored",
            ha="center",
            va="center",
            transform=axes.transAxes,
        )
        axes.set(xticks=[], yticks=[])
        axes.minorticks_off()
        return
    if legend:
        axes.legend()
    if axes.get_yscale() == "log":
        decades = np.ptp(np.log10(axes.get_ylim()))
        steps = next(steps for most, steps in TICKS.items() if decades < most)
        axes.yaxis.set_major_locator(LogLocator(subs=steps))
        axes.yaxis.set_major_formatter(FormatStrFormatter("%g"))
    ticks = sorted(set(minutes))
    if ticks:
        axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    axes.minorticks_off()
