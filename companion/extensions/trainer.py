"""What studies add to the training loop: `StudyTrainer`.

There are alternatives to the adversary: latent distances, and gradient reversal. Two
additions act on the weights: a pull towards the initial weights, and a moving average.
One adds mirror images of motion, left and right exchanged: the paper's robots are the
same on both sides, so a mirror image is also a motion of these robots.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import torch
from torch import Tensor

from sidm.learning.dataset import Datasets, Windows
from sidm.learning.losses import one_sided_loss
from sidm.learning.sampler import PURPOSES, Sampler
from sidm.learning.seeds import generator
from sidm.learning.stopping import CurvePoint
from sidm.learning.trainer import Progress, Trainer
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


class StudyTrainer(Trainer):
    """A model in training with what `StudyTraining` adds to the paper's method.

    'mmd' and 'coral' replace Algorithm 2: without a discriminator, E_n alone moves its
    latents to those of E_e, in as many steps as the distribution matching has.

    'reversal' is the adversary within Algorithm 1 (Ganin and Lempitsky, 2015): the
    encoders get the reversed gradient of the discriminator A.

    `tether` is L2-SP of Li, Grandvalet and Davoine (2018), decoupled from the gradient
    in the way of decoupled weight decay. `averaging` is an exponential moving average
    of the weights, which is tested and kept.
    """

    training: Any  # a `StudyTraining`

    def __init__(self, *arguments: Any, **named: Any) -> None:
        super().__init__(*arguments, **named)
        self.free = [weight.data for weight in trainable_parameters(self.model)]
        training = self.training
        self.anchor = [w.clone() for w in self.free] if training.tether else []
        self.average = [w.clone() for w in self.free] if training.averaging else []
        self.reverses = training.regularise and training.matching == "reversal"

    def make_sampler(self) -> Sampler:
        """With `mirror` one that draws mirror images, too."""
        kind = MirroredSampler if self.training.mirror else Sampler
        return kind(self.datasets, self.training, self.seed, self.device)

    def step_prediction(self, loss: Tensor, latents: Mapping[str, Tensor]) -> None:
        """A step of Algorithm 1, then what acts on the weights."""
        if self.reverses:
            loss = loss + self.reversal_loss(latents)
        super().step_prediction(loss, latents)
        if self.reverses:
            self.discrimination_optimiser.step()
        if self.anchor:
            self.pull_to_start()
        if self.average:
            self.update_average(self.iteration + 1)

    def reversal_loss(self, latents: Mapping[str, Tensor]) -> Tensor:
        """Equation (2) for A on a batch's latents, a scalar; 0 for one system alone."""
        self.discrimination_optimiser.zero_grad()
        if len(latents) < 2:
            return next(iter(latents.values())).new_zeros(())
        weight = self.training.reversal_weight
        # equal to the latents in value, with the derivative -weight
        reversed_latents = {
            role: (1 + weight) * latents[role].detach() - weight * latents[role]
            for role in ("expert", "novice")
        }
        logits = self.discriminate(reversed_latents)
        # one term a system, because their numbers of windows differ
        terms = [one_sided_loss(**{name: values}) for name, values in logits.items()]
        return torch.stack(terms).sum()

    def regularise(self) -> bool:
        """A phase that lessens a distance; none where Algorithm 1 trains A."""
        distance = DISTANCES.get(self.training.matching)
        if distance is None:
            return self.reverses
        for _ in range(self.training.matching_iterations):
            count = self.training.matching_batch
            windows = self.sampler.draw("expert", count, "discriminator expert")
            with torch.no_grad():
                expert = self.model.encode("expert", windows)
            novice = self.model.encode("novice", self.sampler.matching_batch())
            self.step_encoder(distance(expert.flatten(0, 1), novice.flatten(0, 1)))
        return True

    def pull_to_start(self) -> None:
        """Move the weights a part of the way back to their initial values."""
        share = self.training.learning_rate * self.training.tether
        torch._foreach_lerp_(self.free, self.anchor, share)

    def update_average(self, updates: int) -> None:
        """Take the weights into their average, as the update of this number."""
        past = min(self.training.averaging, updates / (updates + WARM_UP))
        torch._foreach_lerp_(self.average, self.free, 1 - past)

    def run_test(self, progress: Progress | None = None) -> CurvePoint:
        """A test of the averaged weights, if there is an average."""
        with self.averaged():
            return super().run_test(progress)

    @contextlib.contextmanager
    def averaged(self) -> Iterator[None]:
        """Give the model the averaged weights inside the block."""
        trained = [weight.clone() for weight in self.free] if self.average else []
        for weight, average in zip(self.free, self.average, strict=False):
            weight.copy_(average)
        try:
            yield
        finally:
            for weight, before in zip(self.free, trained, strict=False):
                weight.copy_(before)

    def added_tensors(self) -> dict[str, Tensor]:
        """The averages by number, in the shapes of the weights."""
        return {str(number): tensor for number, tensor in enumerate(self.average)}

    def restore_added(self, tensors: Mapping[str, Tensor]) -> None:
        """Put back the averages that `added_tensors` gave."""
        for number, average in enumerate(self.average):
            average.copy_(tensors[str(number)])
