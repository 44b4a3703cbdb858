"""Alternatives to the paper's adversary: latent distances, and gradient reversal."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import torch
from torch import Tensor

from sidm.learning.losses import one_sided_loss
from sidm.learning.trainer import Hook, Trainer


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
                expert = trainer.encode("expert", windows).flatten(0, 1)
            novice = trainer.encode("novice", sampler.matching_batch()).flatten(0, 1)
            trainer.step_encoder(self.distance(expert, novice))
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
