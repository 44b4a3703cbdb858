"""CUDA graphs: a GPU repeats a function on fixed shapes without the host."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import torch
from torch import Tensor

WARM_UP = 3  # calls before the capture, in which libraries choose their kernels


class GraphedFunction:
    """A function that a GPU captures at its first call and replays after that.

    On a CPU it is simply called. All arguments are tensors whose shapes never change.
    The first argument, bool, says which trials may change; the warm-up sets all of it
    to False, and then the function must change nothing. The next call overwrites what
    a call has returned.

    Args:
        function: what to compute.
        device: where to compute.
        pool: memory pool that several graphs share. Such graphs must not run at the
            same time, nor use tensors that another one left in the pool.
    """

    def __init__(
        self, function: Callable[..., Any], device: torch.device, pool: Any = None
    ):
        self.function: Callable[..., Any] | None = function
        self.device, self.pool = device, pool
        self.graph: torch.cuda.CUDAGraph | None = None
        self.inputs: tuple[Tensor, ...] = ()
        self.output: Any = None

    def __call__(self, *inputs: Tensor) -> Any:
        """The function's result for `inputs`, whose shapes are those of every call."""
        assert self.function is not None  # not closed
        if self.device.type != "cuda":
            return self.function(*inputs)
        if self.graph is None:
            with torch.cuda.device(self.device):
                self._capture(inputs)
        assert self.graph is not None
        for static, new in zip(self.inputs, inputs, strict=True):
            static.copy_(new)
        self.graph.replay()
        return self.output

    def close(self) -> None:
        """Free the graph, its memory and all that the function refers to."""
        self.function = self.graph = self.output = None
        self.inputs = ()

    def _capture(self, inputs: tuple[Tensor, ...]) -> None:
        assert self.function is not None
        self.inputs = tuple(tensor.to(self.device, copy=True) for tensor in inputs)
        self.inputs[0].zero_()
        stream = torch.cuda.Stream(self.device)
        stream.wait_stream(torch.cuda.current_stream(self.device))
        with torch.cuda.stream(stream):
            for _ in range(WARM_UP):
                self.function(*self.inputs)
        torch.cuda.current_stream(self.device).wait_stream(stream)
        self.graph = torch.cuda.CUDAGraph()
        with torch.cuda.graph(self.graph, pool=self.pool):
            self.output = self.function(*self.inputs)
