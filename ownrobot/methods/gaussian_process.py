"""Gaussian processes: one regression for each component of y, with all its samples.

They see what boosted trees see, and predict how much a column changes, too. The mean of
a process is a weighted sum of kernels, one at each sample that was learnt from, so its
prediction and storage need PyTorch alone. `gaussian_fitting` finds the weights.

Rasmussen and Williams, Gaussian Processes for Machine Learning (2006), equation 2.25.
"""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor

from ownrobot.methods.closed_form import ClosedForm
from ownrobot.methods.trees import features, kept_columns
from sidm.body import Body
from sidm.learning.model import Predictor

ROWS_AT_A_TIME = 512  # each meets every sample: this limits the memory


class Posterior(NamedTuple):
    """Means of several processes that have learnt from the same samples; all float64.

    Attributes:
        mean: (F,), is subtracted from features
        std: (F,), divides features
        samples: (n, F), standardised features that were learnt from
        length_scales: (Y, F), of the kernel exp(-d^2 / 2), in units of `std`
        weights: (n, Y), of the kernels at the samples
        baseline: (Y,), the components far away from all samples
    """

    mean: Tensor
    std: Tensor
    samples: Tensor
    length_scales: Tensor
    weights: Tensor
    baseline: Tensor

    def predict(self, rows: Tensor) -> Tensor:
        """Components (N, Y), float64, at features (N, F), float64."""
        parts = [self._predict_part(part) for part in rows.split(ROWS_AT_A_TIME)]
        return torch.cat(parts) if parts else self.baseline.expand(0, -1)

    def _predict_part(self, rows: Tensor) -> Tensor:
        """Components (N, Y) at a few rows."""
        rows = (rows - self.mean) / self.std
        predicted = [
            _kernel(rows / scales, self.samples / scales) @ weights
            for scales, weights in zip(self.length_scales, self.weights.T, strict=True)
        ]
        return self.baseline + torch.stack(predicted, 1)


def _kernel(rows: Tensor, samples: Tensor) -> Tensor:
    """exp(-d^2 / 2), (N, n), of distances between rows (N, F) and samples (n, F)."""
    squares = rows.square().sum(1)[:, None] + samples.square().sum(1)
    return (
        torch.addmm(squares, rows, samples.T, alpha=-2).clamp_min_(0).mul_(-0.5).exp_()
    )


class GaussianProcess(ClosedForm):
    """Predicts transitions (B, T, Y) with Gaussian processes.

    They correct a base, the expert's model without a memory, or predict the changes of
    columns. The memory is the last x, (B, 1, X); at a drive's first step the x before
    is x itself.
    """

    scale: Tensor | None

    def __init__(
        self,
        body: Body,
        posterior: Posterior,
        base: Predictor | None = None,
        scale: Tensor | None = None,
    ):
        super().__init__(scale)
        self.body, self.base = body, base
        self.keep(posterior)

    @property
    def posterior(self) -> Posterior:
        """The processes."""
        return Posterior(*(getattr(self, name).data for name in Posterior._fields))

    def forward(
        self, role: str, inputs: Tensor, maps: Tensor, memory: Tensor | None = None
    ):
        """Transitions (B, T, Y) in raw units, and the last x (B, 1, X)."""
        rows = features(inputs, maps, self.body, memory)
        changes = self.posterior.predict(rows.flatten(0, 1))
        begun = first_guess(inputs, maps, self.body, self.base)
        predicted = begun + changes.unflatten(0, rows.shape[:2])
        return predicted.to(inputs.dtype), inputs[:, -1:]


def first_guess(
    inputs: Tensor, maps: Tensor, body: Body, base: Predictor | None
) -> Tensor:
    """What the processes add to, (B, T, Y), float64: a base, or columns as they are."""
    if base is None:
        return kept_columns(inputs, body)
    with torch.inference_mode():
        predicted, _ = base("novice", inputs, maps)
    return predicted.double()
