"""Learning curves that can be watched while a trial runs: TensorBoard event files.

`tensorboard --logdir DIR` shows them; the package of that name writes them and is an
optional extra.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from sidm.learning.stopping import CurvePoint

if TYPE_CHECKING:
    from torch.utils.tensorboard import SummaryWriter

    from companion.trials import Trial


class EventLog:
    """The event files under a folder, one folder for each trial.

    Args:
        folder: where to write; nothing is written by default.

    Raises:
        ImportError: TensorBoard is asked for and not installed; the message is one
            line.
    """

    def __init__(self, folder: str | Path | None):
        self.folder = None if folder is None else Path(folder)
        self._files = contextlib.ExitStack()
        self._writers: dict[str, SummaryWriter] = {}
        if self.folder is not None:
            _writer_class()

    def __enter__(self) -> EventLog:
        return self

    def __exit__(self, *error: object) -> None:
        self._files.close()

    def progress(
        self, trial: Trial, also: Callable[[CurvePoint], None] | None = None
    ) -> Callable[[CurvePoint], None]:
        """A callback for `train` that logs each test, then calls `also`."""

        def write(tested: CurvePoint) -> None:
            if self.folder is not None:
                self._write(self.folder, trial, tested)
            if also is not None:
                also(tested)

        return write

    def _write(self, folder: Path, trial: Trial, tested: CurvePoint) -> None:
        if trial.key not in self._writers:
            name = f"{trial} {trial.key}".replace(" ", "-")
            self._writers[trial.key] = self._files.enter_context(
                _writer_class()(str(folder / name))
            )
        writer = self._writers[trial.key]
        writer.add_scalar("loss/test", tested.test_loss, tested.samples)
        writer.add_scalar("loss/training", tested.training_loss, tested.samples)
        if tested.discriminator_accuracy is not None:
            writer.add_scalar(
                "discriminator/accuracy", tested.discriminator_accuracy, tested.samples
            )
        writer.flush()


def _writer_class() -> type[SummaryWriter]:
    try:
        from torch.utils.tensorboard import SummaryWriter
    except ImportError:
        raise ImportError(
            "event files need TensorBoard: pip install tensorboard, or name no log "
            "folder"
        ) from None
    return SummaryWriter
