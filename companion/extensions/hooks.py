"""Hooks of the training loop that studies add to the paper's method.

There are alternatives to the adversary: latent distances, and gradient reversal. Two
hooks act on the weights: a pull towards the initial weights, and a moving average. One
adds mirror images of motion, left and right exchanged: the paper's robots are the same
on both sides, so a mirror image is also a motion of these robots.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Mapping

import torch
from torch import Tensor

from sidm.learning.dataset import Datasets, Windows
from sidm.learning.losses import one_sided_loss
from sidm.learning.sampler import PURPOSES, Sampler
from sidm.learning.seeds import generator
from sidm.learning.trainer import Hook, Trainer
from sidm.learning.weights import trainable_parameters
from sidm.settings import Training

#: Updates: after n of them, the past has at most weight n / (n + WARM_UP).
WARM_UP = 10
#: Signs of the components in the mirror image, in the order of the tables of
#: `observation`. Vectors change the sign of y; axes of rotation change the signs of x
#: and z; the steering angle changes its sign.
INPUT_SIGNS = (1, -1, 1, 1, -1, 1, -1, 1, -1, 1, -1)
TARGET_SIGNS = (1, -1, 1, -1, 1, -1, 1, 1, -1, 1, -1, 1, -1)


def mmd(first: Tensor, second: Tensor) -> Tensor:
    """Squared maximum mean discrepancy (Gretton et al., 2012) of (N, K) and (M, K).

    The kernel is the mean of three Gaussian kernels, whose widths are half, once and
    twice the median squared distance. The value is 0 for equal samples.
    """
    both = torch.cat([first, second])
    squares = torch.cdist(both, both, compute_mode="use_mm_for_euclid_dist").square()
    unit = squares.detach().median()
    kernel = torch.stack(
        [torch.exp(-squares / (width * unit)) for width in (0.5, 1.0, 2.0)]
    ).mean(0)
    n = len(first)
    return kernel[:n, :n].mean() + kernel[n:, n:].mean() - 2 * kernel[:n, n:].mean()


def coral(first: Tensor, second: Tensor) -> Tensor:
    """Distance between covariances, after Sun and Saenko (2016), and between means.

    Their loss ignores the means. Here a shift of the mean counts, too, because it
    counts for the adversary.
    """
    shift = (first.mean(0) - second.mean(0)).square().mean()
    return shift + (torch.cov(first.T) - torch.cov(second.T)).square().mean()


#: Setting -> distance between the distributions of latents (N, K) and (M, K).
DISTANCES: dict[str, Callable[[Tensor, Tensor], Tensor]] = {"mmd": mmd, "coral": coral}


class DistanceMatching(Hook):
    """Algorithm 2 without a discriminator: E_n alone moves its latents to those of E_e.

    It takes as many steps as the distribution matching of Algorithm 2 has.
    """

    def __init__(self, name: str) -> None:
        self.distance = DISTANCES[name]

    def regularise(self, trainer: Trainer) -> bool:
        """One phase."""
        training, sampler = trainer.training, trainer.sampler
        for _ in range(training.matching_iterations):
            count = training.matching_batch
            windows = sampler.draw("expert", count, "discriminator expert")
            with torch.no_grad():
                expert = trainer.model.encode("expert", windows)
            novice = trainer.model.encode("novice", sampler.matching_batch())
            loss = self.distance(expert.flatten(0, 1), novice.flatten(0, 1))
            trainer.step_encoder(loss)
        return True


class GradientReversal(Hook):
    """The adversary within Algorithm 1 (Ganin and Lempitsky, 2015).

    The encoders get the reversed gradient of the discriminator A, times `weight`.
    """

    def __init__(self, weight: float) -> None:
        self.weight = weight

    def auxiliary_loss(self, trainer: Trainer, latents: Mapping[str, Tensor]) -> Tensor:
        """Equation (2) for A on a batch's latents, a scalar; 0 for one system alone."""
        trainer.discrimination_optimiser.zero_grad()
        if len(latents) < 2:
            return next(iter(latents.values())).new_zeros(())
        # equal to the latents in value, with the derivative -weight
        reversed_latents = {
            role: (1 + self.weight) * latents[role].detach()
            - self.weight * latents[role]
            for role in ("expert", "novice")
        }
        logits = trainer.discriminate(reversed_latents)
        # one term a system, because their numbers of windows differ
        terms = [one_sided_loss(**{name: values}) for name, values in logits.items()]
        return torch.stack(terms).sum()

    def after_step(self, trainer: Trainer) -> None:
        """Take a step of the discriminator A."""
        trainer.discrimination_optimiser.step()

    def regularise(self, trainer: Trainer) -> bool:
        """Skip Algorithm 2, because Algorithm 1 has trained A and the encoders."""
        return True


class PullToStart(Hook):
    """Pulls the weights towards their initial values after each step.

    L2-SP of Li, Grandvalet and Davoine (2018), decoupled from the gradient in the way
    of decoupled weight decay. `share` is the share of the way back, per unit of
    learning rate.
    """

    def __init__(self, share: float) -> None:
        self.share = share

    def begin(self, trainer: Trainer) -> None:
        """Keep a copy of the initial weights."""
        self.pull = trainer.training.learning_rate * self.share
        self.weights = [p.data for p in trainable_parameters(trainer.model)]
        self.anchor = [weight.clone() for weight in self.weights]

    def after_step(self, trainer: Trainer) -> None:
        """Move the weights a part of the way back."""
        torch._foreach_lerp_(self.weights, self.anchor, self.pull)


class WeightAverage(Hook):
    """Exponential moving average of the weights, which is tested and kept.

    `past` is the weight of the past in the average, above 0 and below 1.
    """

    def __init__(self, past: float) -> None:
        self.past, self.updates = past, 0

    def begin(self, trainer: Trainer) -> None:
        """Start the average at the initial weights."""
        self.weights = [p.data for p in trainable_parameters(trainer.model)]
        self.average = [weight.clone() for weight in self.weights]

    def after_step(self, trainer: Trainer) -> None:
        """Update the average with the new weights."""
        self.updates += 1
        past = min(self.past, self.updates / (self.updates + WARM_UP))
        torch._foreach_lerp_(self.average, self.weights, 1 - past)

    @contextlib.contextmanager
    def testing(self) -> Iterator[None]:
        """Give the model the averaged weights inside the block."""
        trained = [weight.clone() for weight in self.weights]
        for weight, average in zip(self.weights, self.average, strict=True):
            weight.copy_(average)
        try:
            yield
        finally:
            for weight, before in zip(self.weights, trained, strict=True):
                weight.copy_(before)

    def tensors(self) -> dict[str, Tensor]:
        """The averages by number, in the shapes of the weights."""
        return {str(number): tensor for number, tensor in enumerate(self.average)}

    def restore(self, tensors: Mapping[str, Tensor], updates: int) -> None:
        """Put back the averages that `tensors` gave after `updates` updates."""
        for number, tensor in tensors.items():
            self.average[int(number)].copy_(tensor)
        self.updates = updates


def mirrored(motion: Windows, which: Tensor) -> Windows:
    """A motion with the trajectories `which` (N,), bool, in mirror image."""

    def mirror(values: Tensor, signs: tuple[int, ...]) -> Tensor:
        images = values * values.new_tensor(signs)
        return torch.where(which[:, None, None], images, values)

    # axis -2 of a map runs to the left
    maps = torch.where(which[:, None, None, None], motion.maps.flip(-2), motion.maps)
    return Windows(
        mirror(motion.inputs, INPUT_SIGNS), mirror(motion.targets, TARGET_SIGNS), maps
    )


def mirror_image(windows: Windows) -> Windows:
    """All windows in mirror image."""
    return mirrored(windows, torch.ones(len(windows), dtype=torch.bool))


class MirroredSampler(Sampler):
    """Draws windows and their mirror images, each with probability 0.5.

    Indices from the number of a system's windows upwards stand for mirror images.
    """

    def __init__(
        self, datasets: Datasets, training: Training, seed: int, device: torch.device
    ) -> None:
        super().__init__(datasets, training, seed, device)
        self.generators |= {
            f"{purpose} mirrored": generator(seed, f"{purpose} mirrored")
            for purpose in PURPOSES[1:]
        }

    def indices(self, role: str, count: int, purpose: str) -> Tensor:
        """Random indices (count,) int64 of a system's windows and mirror images."""
        indices = super().indices(role, count, purpose)
        noise = torch.rand(count, generator=self.generators[f"{purpose} mirrored"])
        return indices + len(self.windows[role]) * (noise < 0.5)

    def take(self, role: str, which: Tensor) -> Windows:
        """Windows (b, T) of a system, or mirror images, by numbers from `indices`."""
        windows = self.windows[role]
        count = len(windows)
        return mirrored(windows.take(which % count), which >= count).to(self.device)


class Mirroring(Hook):
    """Training on windows and their mirror images, each with probability 0.5."""

    def sampler(
        self, datasets: Datasets, training: Training, seed: int, device: torch.device
    ) -> Sampler:
        """A sampler that draws mirror images, too."""
        return MirroredSampler(datasets, training, seed, device)
