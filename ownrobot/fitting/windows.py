"""Windows of equal length from drives, and predictions from them."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence

import numpy as np
import torch
from torch import Tensor

from sidm.config import ConfigError, replace
from sidm.drives import STEPS, AnyGround, Drive, SimulatedGround
from sidm.learning.dataset import states_and_actions, windows_of
from sidm.learning.evaluation import EVALUATION_BATCH, rollout
from sidm.learning.model import Predictor
from sidm.storage import checksum

Steps = tuple[Tensor, Tensor]  # (K, Y), predicted and actual transitions of a drive

#: Steps of a drive that are encoded at once, which limits the memory for height maps.
CHUNK = 256
#: Largest share of a robot's steps in drives that are shorter than a window.
SHORT_SHARE = 0.05


def common_length(*robots: Sequence[Drive]) -> int:
    """Steps T of a window for all robots, at most 64.

    T is the largest number for which, of each robot, the drives with fewer than T steps
    have at most SHORT_SHARE of all steps.
    """
    longest = STEPS
    for drives in robots:
        lengths = np.sort([len(drive) for drive in drives])
        shorter = np.cumsum(lengths) - lengths  # steps of the drives before
        fits = lengths[shorter <= SHORT_SHARE * lengths.sum()]
        longest = min(longest, int(fits[-1]))
    return longest


def cut(
    drives: Sequence[Drive], steps: int = STEPS, overlap: bool = False
) -> list[Drive]:
    """Consecutive windows of `steps` steps, cut from the start of each drive.

    Shorter drives are left out. With `overlap` a drive's last window ends where the
    drive ends; otherwise the rest of a drive is left out.
    """
    windows = []
    for drive in drives:
        last = len(drive) - steps
        firsts = list(range(0, last + 1, steps))
        if overlap and firsts and firsts[-1] < last:
            firsts.append(last)
        windows += [part_of(drive, first, first + steps) for first in firsts]
    if not windows:
        raise ConfigError(
            f"no drive of {len(drives)} has {steps} steps; record longer ones"
        )
    return windows


def part_of(drive: Drive, first: int, last: int) -> Drive:
    """The drive's steps from `first` up to `last`, which is not included."""
    return replace(
        drive,
        states=drive.states[first : last + 1],
        actions=drive.actions[first:last],
    )


def grounds_of(drives: Sequence[Drive]) -> np.ndarray:
    """(N,) int, the number of each drive's ground.

    Grounds are numbered from 0 in the order in which they first occur. Drives without a
    ground share one number.
    """
    grounds = {id(drive.ground): drive.ground for drive in drives}
    keys = {number: ground_key(ground) for number, ground in grounds.items()}
    numbers: dict[str, int] = {}
    found = (keys[id(drive.ground)] for drive in drives)
    return np.array([numbers.setdefault(key, len(numbers)) for key in found])


def ground_key(ground: AnyGround | None) -> str:
    """Text that is the same for equal grounds only."""
    if ground is None:
        return ""
    if isinstance(ground, SimulatedGround):
        return f"{ground.terrain} {ground.seed}"
    return f"{checksum(ground.heights)} {ground.spacing} {ground.centre}"


def split_by_ground(drives: Sequence[Drive], held_out: int) -> tuple[Tensor, Tensor]:
    """Numbers of the windows to learn from, (n,), and to evaluate on, (m,).

    The windows on the last `held_out` grounds are for evaluation.
    """
    grounds = torch.from_numpy(grounds_of(drives))
    count = int(grounds.max()) + 1
    if not 0 < held_out < count:
        raise ValueError(f"from 1 to {count - 1} of {count} grounds, not {held_out}")
    is_held_out = grounds >= count - held_out
    return torch.nonzero(~is_held_out).flatten(), torch.nonzero(is_held_out).flatten()


def rollouts(
    model: Predictor,
    drives: Sequence[Drive],
    start: int,
    steps: int,
    pixels: int = 0,
    seen: bool = True,
) -> Tensor:
    """Open-loop predictions (N, K + 1, S) from step `start` of each of N windows.

    The first state is the recorded one at `start`. If `seen`, the model first sees the
    recorded steps before; otherwise its memory is empty at `start`.
    """
    states, actions = states_and_actions(drives)
    path = states[:, start : start + steps + 1].clone()
    grounds, body = grounds_of(drives), drives[0].body
    for number in range(int(grounds.max()) + 1):
        rows = np.flatnonzero(grounds == number)
        group = [drives[row] for row in rows.tolist()]
        memory = None
        if seen and start:
            before = windows_of([part_of(d, 0, start) for d in group], pixels)
            with torch.inference_mode():
                _, memory = model("novice", before.inputs, before.maps)
        heights, spacing = None, 0.0
        if body.map_size:
            ground = group[0].ground
            assert ground is not None
            heights = torch.from_numpy(ground.heights).expand(len(group), -1, -1)
            spacing = ground.spacing
        path[rows] = rollout(
            model,
            heights,
            states[rows, start],
            actions[rows, start : start + steps],
            pixels,
            spacing=spacing,
            body=body,
            memory=memory,
        )
    return path


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
