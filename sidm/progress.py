"""Progress with the time left: one changing line where someone looks, lines in a log.

Someone looks at a terminal or at a notebook.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any, TextIO, TypeAlias

from tqdm import tqdm

LOG_INTERVAL = 30.0  # s between two lines in a log
LINE = (
    "{desc}: {n_fmt}/{total_fmt} {unit}, {elapsed} gone, {remaining} left, "
    "{rate_fmt}{postfix}"
)


class LogBar(tqdm):
    """A progress bar for a log file: whole lines, the first one after LOG_INTERVAL.

    Work that ends before the first line is due writes nothing.
    """

    last_print_t: float

    def __init__(self, **options: Any):
        often = {"mininterval": LOG_INTERVAL, "delay": LOG_INTERVAL, "miniters": 1}
        super().__init__(file=sys.stderr, bar_format=LINE, **often, **options)

    @staticmethod
    def status_printer(file: TextIO) -> Callable[[str], None]:
        """A function that writes the bar's text as a line of `file`."""
        return lambda text: print(text, file=file, flush=True)

    @staticmethod
    def write(text: str, file: TextIO | None = None) -> None:
        """Print a line between the bar's lines."""
        print(text, file=file, flush=True)

    def close(self) -> None:
        """Write a last line if the work is complete and a line was written before."""
        if not self.disable:
            written = self.start_t < self.last_print_t
            if written and self.last_print_n < self.n == self.total:
                self.display()
            # tqdm's own `close` writes nothing for a bar that has written nothing.
            self.last_print_t = self.start_t - 1
        super().close()


Bar: TypeAlias = tqdm


def progress_bar(
    total: int, title: str, unit: str, shown: bool = True, scaled: bool = False
) -> Bar:
    """A bar on stderr that counts to `total`, with `k` and `M` if `scaled`.

    It is that of `tqdm` on a terminal and in a notebook, and a `LogBar` elsewhere.
    """
    shown = shown and sys.stderr is not None  # a process may have none
    notebook = type(sys.stderr).__module__.startswith("ipykernel")
    terminal = sys.stderr is not None and sys.stderr.isatty()
    kind = tqdm if terminal or notebook else LogBar
    shown = shown and total > 0
    return kind(
        total=total, desc=title, unit=unit, unit_scale=scaled, disable=not shown
    )
