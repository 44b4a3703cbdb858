"""Progress with the time left: one line that changes on a terminal, a line now and then in a log file."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any, TextIO, TypeAlias

from tqdm import tqdm

LOG_INTERVAL = 30.0  # s between two lines in a log
LINE = "{desc}: {n_fmt}/{total_fmt} {unit}, {elapsed} gone, {remaining} left, {rate_fmt}{postfix}"


class LogBar(tqdm):
    """A bar for a file: whole lines, and none for work that is over before the first is due."""

    last_print_t: float

    def __init__(self, **options: Any):
        often = {"mininterval": LOG_INTERVAL, "delay": LOG_INTERVAL, "miniters": 1}
        super().__init__(file=sys.stderr, bar_format=LINE, **often, **options)

    @staticmethod
    def status_printer(file: TextIO) -> Callable[[str], None]:
        """What writes a state of the bar."""
        return lambda text: print(text, file=file, flush=True)

    @staticmethod
    def write(text: str, file: TextIO | None = None) -> None:
        """Print a line beside the bar's."""
        print(text, file=file, flush=True)

    def close(self) -> None:
        """Say once more where it is, if it is at its end and has said something before."""
        if not self.disable:
            if (
                self.start_t < self.last_print_t
                and self.last_print_n < self.n == self.total
            ):
                self.display()
            # as one that has shown nothing, which tqdm leaves alone
            self.last_print_t = self.start_t - 1
        super().close()


Bar: TypeAlias = tqdm


def progress_bar(
    total: int, title: str, unit: str, shown: bool = True, scaled: bool = False
) -> Bar:
    """A bar that counts to `total` on stderr: `tqdm` on a terminal, lines elsewhere; `scaled` writes k and M."""
    kind = tqdm if sys.stderr.isatty() else LogBar
    return kind(
        total=total, desc=title, unit=unit, unit_scale=scaled, disable=not shown
    )
