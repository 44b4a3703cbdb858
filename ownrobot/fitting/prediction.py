"""Predictions of whole drives, one step ahead."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence

import torch
from torch import Tensor

from ownrobot.fitting.windows import part_of
from sidm.drives import Drive
from sidm.learning.dataset import windows_of
from sidm.learning.evaluation import EVALUATION_BATCH
from sidm.learning.model import Predictor

#: Steps of a drive that are encoded at once, which limits the memory for height maps.
CHUNK = 256

Steps = tuple[Tensor, Tensor]  # (K, Y), predicted and actual transitions of a drive


def predict_steps(
    predictor: Predictor, drives: Sequence[Drive], pixels: int
) -> list[Steps]:
    """Predicted and actual transitions (K, Y) of each drive, one step ahead, raw units.

    Each prediction is from the recorded state before it. A recurrent network keeps its
    memory from a drive's start to its end.
    """
    by_length = defaultdict(list)  # drives of one length make batches
    for number, drive in enumerate(drives):
        by_length[len(drive)].append(number)
    results: dict[int, Steps] = {}
    for numbers in by_length.values():
        for first in range(0, len(numbers), EVALUATION_BATCH):
            batch = numbers[first : first + EVALUATION_BATCH]
            steps = _predict_batch(predictor, [drives[n] for n in batch], pixels)
            results |= zip(batch, zip(*steps, strict=True), strict=True)
    return [results[number] for number in range(len(drives))]


def _predict_batch(predictor: Predictor, drives: Sequence[Drive], pixels: int) -> Steps:
    """Predicted and actual transitions (B, K, Y) of B drives of equal length."""
    memory, parts = None, []
    for first in range(0, len(drives[0]), CHUNK):
        last = min(first + CHUNK, len(drives[0]))
        windows = windows_of([part_of(d, first, last) for d in drives], pixels)
        with torch.inference_mode():
            predicted, memory = predictor(
                "novice", windows.inputs, windows.maps, memory
            )
        parts.append((predicted, windows.targets))
    predicted, actual = (torch.cat(pair, dim=1) for pair in zip(*parts, strict=True))
    return predicted, actual
