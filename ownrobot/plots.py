"""Style, layout and finish of all figures.

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
#: inch, of a figure: on a page of 690 pixels its text is as large as the captions
WIDTH = 7.2
HEIGHTS = {1: 4.2, 2: 3.3}  # inch, of a plot, by how many stand side by side


def styled(draw: Callable[..., Figure]) -> Callable[..., Figure]:
    """Decorate a function that draws: it uses the book's style, closes the figure."""

    @functools.wraps(draw)
    def drawn(*arguments: Any, **options: Any) -> Figure:
        import matplotlib.pyplot as plt

        with plt.style.context(STYLE):
            figure = draw(*arguments, **options)
        plt.close(figure)
        return figure

    return drawn


def side_by_side(count: int, columns: int = 0) -> tuple[Figure, list[Axes]]:
    """A figure of `count` plots, in rows of `columns` or all in one, and its axes."""
    import matplotlib.pyplot as plt

    columns = columns or count
    rows = -(-count // columns)
    size = WIDTH, HEIGHTS.get(columns, HEIGHTS[2]) * rows
    figure, axes = plt.subplots(
        rows, columns, figsize=size, squeeze=False, layout="constrained"
    )
    return figure, list(axes.flat)


#: Fewer decades than this on a logarithmic axis -> its ticks within each decade.
TICKS: dict[float, tuple[float, ...]] = {
    0.6: (1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0),
    1.0: (1.0, 1.5, 2.0, 3.0, 5.0, 7.0),
    2.0: (1.0, 2.0, 5.0),
    np.inf: (1.0,),
}


def finish(
    axes: Axes,
    minutes: Iterable[float] = (),
    legend: bool = True,
    notice: str = "no trials stored",
) -> None:
    """Add a legend and ticks in plain numbers to a plot, or a notice if it is empty.

    `minutes` are the places of the ticks on the x axis, by default Matplotlib's own.
    """
    from matplotlib.ticker import FormatStrFormatter, LogLocator

    if not axes.has_data():
        centred: dict[str, Any] = {"ha": "center", "va": "center"}
        axes.text(0.5, 0.5, notice, transform=axes.transAxes, **centred)
        axes.set(xticks=[], yticks=[])
        axes.minorticks_off()
        return
    if legend:
        axes.legend()
    if axes.get_yscale() == "log":
        decades = np.ptp(np.log10(axes.get_ylim()))
        ticks_of_decade = next(t for most, t in TICKS.items() if decades < most)
        axes.yaxis.set_major_locator(LogLocator(subs=ticks_of_decade))
        axes.yaxis.set_major_formatter(FormatStrFormatter("%g"))
    ticks = sorted(set(minutes))
    if ticks:
        axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    axes.minorticks_off()
