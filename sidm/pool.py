"""Run calls in this process or in worker processes that end with their parent."""

from __future__ import annotations

import ast
import concurrent.futures
import contextlib
import functools
import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor, Future, ProcessPoolExecutor
from pathlib import Path
from typing import Any

from sidm.config import ConfigError


@contextlib.contextmanager
def local_pool(workers: int) -> Iterator[Executor]:
    """An executor for a `with` block: new processes, or this one for one worker."""
    if workers > 1:
        with process_pool(workers) as pool:
            yield pool
    else:
        yield _ThisProcess()


@contextlib.contextmanager
def process_pool(workers: int) -> Iterator[Executor]:
    """New processes (spawn) for a block; an error or Ctrl-C in it ends them at once."""
    _refuse_script_without_guard()
    context = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(
        workers, mp_context=context, initializer=_end_with_parent
    )
    try:
        yield pool
    except BaseException:
        for process in list((pool._processes or {}).values()):
            process.terminate()
        pool.shutdown(wait=False, cancel_futures=True)
        raise
    pool.shutdown()


def as_completed(futures: Iterable[Future]) -> Iterator[Future]:
    """Futures as they are done; calls in this process run when their turn comes."""
    futures = list(futures)
    if all(isinstance(future, _Call) for future in futures):
        for future in futures:
            future.exception()
            yield future
    else:
        yield from concurrent.futures.as_completed(futures)


class _ThisProcess(Executor):
    """Runs a call in this process when its result is first asked for."""

    def submit(self, call: Callable, /, *arguments: Any, **options: Any) -> Future:
        return _Call(functools.partial(call, *arguments, **options))


class _Call(Future):
    """A call that runs when its result or its exception is first asked for."""

    def __init__(self, call: Callable[[], Any]) -> None:
        super().__init__()
        self._call = call

    def result(self, timeout: float | None = None) -> Any:
        self.exception()
        return super().result(timeout)

    def exception(self, timeout: float | None = None) -> BaseException | None:
        if not self.done():
            try:
                self.set_result(self._call())
            except Exception as error:
                self.set_exception(error)
        return super().exception(timeout)


def _end_with_parent() -> None:
    """Initialise a worker: it ends silently on Ctrl-C and when the parent has ended."""
    # A parent in the background ignores Ctrl-C, and so does its worker.
    if signal.getsignal(signal.SIGINT) is not signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    parent = multiprocessing.parent_process()

    def watch() -> None:
        if parent is not None:
            parent.join()
            os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


def _refuse_script_without_guard() -> None:
    """Refuse workers where each of them would run the whole script again.

    A new process imports the script that was started. A call that stands in it outside
    of `if __name__ == "__main__":` would so be run by every worker, too.
    """
    script = getattr(sys.modules["__main__"], "__file__", None)
    frame = sys._getframe()
    while frame.f_back is not None and frame.f_globals.get("__name__") != "__main__":
        frame = frame.f_back
    while frame.f_back is not None and frame.f_code.co_name != "<module>":
        frame = frame.f_back
    if script is None or frame.f_code.co_filename != script:
        return  # an interactive session, or a program without a file
    line = frame.f_lineno
    guarded = any(
        isinstance(node, ast.If)
        and node.lineno <= line <= (node.end_lineno or 0)
        and "__name__" in ast.unparse(node.test)
        for node in ast.walk(ast.parse(Path(script).read_bytes()))
    )
    if not guarded:
        raise ConfigError(
            f"{script}, line {line}: with more than one worker this must stand under "
            "'if __name__ == \"__main__\":'; or take workers=1"
        )
