"""Work on tensors of fixed shapes that a GPU repeats without the host: a CUDA graph."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import torch
from torch import Tensor

WARM_UP = 3  # calls before recording, in which libraries choose their kernels


class Recorded:
    """`work`, recorded at its first call on a GPU and replayed from then on; on a CPU simply called.

    Its first argument, bool, says which trials may change; with none of them it must
    change nothing, for so it is warmed up. All arguments are tensors whose shapes stay.
    What it returns is overwritten by the next call. Works of one `pool` share memory:
    none may run beside another, nor use what another left there.
    """

    def __init__(
        self, work: Callable[..., Any], device: torch.device, pool: Any = None
    ):
        self.work: Callable[..., Any] | None = work
        self.device, self.pool = device, pool
        self.graph: torch.cuda.CUDAGraph | None = None
        self.inputs: tuple[Tensor, ...] = ()
        self.output: Any = None

    def __call__(self, *inputs: Tensor) -> Any:
        """Do the work on `inputs`, which keep their shapes from call to call."""
        assert self.work is not None  # not closed
        if self.device.type != "cuda":
            return self.work(*inputs)
        if self.graph is None:
            with torch.cuda.device(self.device):
                self._record(inputs)
        assert self.graph is not None
        for mine, new in zip(self.inputs, inputs, strict=True):
            mine.copy_(new)
        self.graph.replay()
        return self.output

    def close(self) -> None:
        """Let go of the graph, its memory, and what the work refers to."""
        self.work = self.graph = self.output = None
        self.inputs = ()

    def _record(self, inputs: tuple[Tensor, ...]) -> None:
        assert self.work is not None
        self.inputs = tuple(one.to(self.device, copy=True) for one in inputs)
        self.inputs[0].zero_()
        stream = torch.cuda.Stream(self.device)
        stream.wait_stream(torch.cuda.current_stream(self.device))
        with torch.cuda.stream(stream):
            for _ in range(WARM_UP):
                self.work(*self.inputs)
        torch.cuda.current_stream(self.device).wait_stream(stream)
        self.graph = torch.cuda.CUDAGraph()
        with torch.cuda.graph(self.graph, pool=self.pool):
            self.output = self.work(*self.inputs)
