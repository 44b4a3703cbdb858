"""How many samples a second the prediction phase takes on one thread, beside the released loop's figures."""

from __future__ import annotations

import torch
from rounds import rate, report

from sidm.learning import Datasets, Motion, Network, Training
from sidm.learning.learner import Learner
from sidm.learning.training import predict_phase

RELEASED = 676.0  # samples a second on two cores: batch 2 x 64, 64 px, LSTM 3 x 256
STEPS = 64


def learner(pixels: int, batch: int) -> Learner:
    """A training on random numbers, which take as long as real ones."""
    draw = torch.Generator().manual_seed(0)
    sizes = (20, STEPS, 11), (20, STEPS, 13), (20, STEPS, pixels, pixels)
    inputs, targets, maps = (torch.randn(size, generator=draw) for size in sizes)
    motion = Motion(inputs, targets, maps.half())
    training = Training(batch=batch, prediction_iterations=5, test_interval=10**6, max_samples=10**9)
    sets = Datasets(train=motion, test=motion, validation=motion, expert=motion)
    return Learner(sets, Network(pixels=pixels), training, seed=0)


def main() -> None:
    """Measure the laptop preset's workload and the released code's."""
    torch.set_num_threads(1)
    for name, pixels, batch, released in (
        ("32 px, 3 x 256, batch 8 x 64", 32, 8, None),
        ("64 px, 3 x 256, batch 2 x 64 (as released)", 64, 2, RELEASED),
    ):
        running = learner(pixels, batch)

        def work(running: Learner = running) -> int:
            before = running.samples
            predict_phase(running)
            return running.samples - before

        report(name, rate(work, rounds=5), "samples a s of CPU", released)


if __name__ == "__main__":
    main()
