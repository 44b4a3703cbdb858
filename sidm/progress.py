"""Progress with the time left: one line that changes on a terminal, a line now and then in a log file."""

from __future__ import annotations

import sys
import time
from typing import Any, TextIO, TypeAlias

from tqdm import tqdm

LOG_INTERVAL = 30.0  # s between two lines in a log


class LogBar:
    """What is used of `tqdm`, for a file: whole lines, and none for work that is over before the first is due."""

    def __init__(self, total: int, title: str, unit: str, shown: bool, scaled: bool):
        self.total, self.title, self.unit, self.shown, self.scaled = total, title, unit, shown, scaled
        self.n, self.postfix = 0, ""
        self._start = self._last = time.monotonic()

    def __enter__(self) -> LogBar:
        return self

    def __exit__(self, *error: object) -> None:
        if self._last != self._start and self.n == self.total:
            self._print()

    def update(self, count: float = 1) -> None:
        """So much more is done."""
        self.n += count  # type: ignore[assignment]
        if time.monotonic() - self._last >= LOG_INTERVAL and self.n != self.total:
            self._last = time.monotonic()
            self._print()

    def set_postfix(self, refresh: bool = True, **values: Any) -> None:
        """What stands behind the time left."""
        self.postfix = ", ".join(f"{name}={value}" for name, value in values.items())

    @staticmethod
    def write(text: str, file: TextIO | None = None) -> None:
        """Print a line beside the bar's."""
        print(text, file=file, flush=True)

    def _print(self) -> None:
        if self.shown:
            elapsed = time.monotonic() - self._start
            print(
                tqdm.format_meter(self.n, self.total, elapsed, prefix=self.title, unit=self.unit, postfix=self.postfix,
                                  unit_scale=self.scaled, bar_format="{desc}: {n_fmt}/{total_fmt} {unit}, "
                                  "{elapsed} gone, {remaining} left, {rate_fmt}{postfix}"),
                file=sys.stderr, flush=True,
            )  # fmt: skip


Bar: TypeAlias = "tqdm | LogBar"


def progress_bar(total: int, title: str, unit: str, shown: bool = True, scaled: bool = False) -> Bar:
    """A bar that counts to `total` on stderr: `tqdm` on a terminal, lines elsewhere; `scaled` writes k and M."""
    if sys.stderr.isatty():
        return tqdm(total=total, desc=title, unit=unit, unit_scale=scaled, disable=not shown)
    return LogBar(total, title, unit, shown, scaled)
