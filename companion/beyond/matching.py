"""What stands in for the paper's adversary: distances between the latents' distributions, and gradient reversal."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import torch
from torch import Tensor

from sidm.learning.losses import one_sided_loss
from sidm.learning.trainer import Hook, Trainer


def mmd(first: Tensor, second: Tensor) -> Tensor:
    """Squared maximum mean discrepancy (Gretton et al., 2012) of samples (N, K) and (M, K): a scalar, 0 for equal ones.

    The kernel is the mean of three Gaussian ones, as wide as half, once and twice the
    median squared distance.
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
    """Distance of the covariances of samples (N, K) and (M, K), after Sun and Saenko (2016), and of their means.

    Their loss leaves the means alone; here a shift counts too, as it does for the
    adversary.
    """
    shift = (first.mean(0) - second.mean(0)).square().mean()
    return shift + (torch.cov(first.T) - torch.cov(second.T)).square().mean()


#: Distances between the distributions of latents (N, K) and (M, K), by the setting that
#: chooses them.
DISTANCES: dict[str, Callable[[Tensor, Tensor], Tensor]] = {"mmd": mmd, "coral": coral}


class DistanceMatching(Hook):
    """Algorithm 2 without a discriminator: E_n moves its latents toward those of E_e.

    Args:
        name: of the distance, one of DISTANCES.
    """

    def __init__(self, name: str) -> None:
        self.distance = DISTANCES[name]

    def regularise(self, trainer: Trainer) -> bool:
        """As many steps as Algorithm 2 has."""
        for _ in range(trainer.training.matching_iterations):
            self.iteration(trainer)
        return True

    def iteration(self, trainer: Trainer) -> None:
        """One step of E_n alone down the distance between its latents and those of E_e."""
        count, sampler = trainer.training.matching_batch, trainer.sampler
        with torch.no_grad():
            expert = trainer.encode(
                "expert", sampler.draw("expert", count, "discriminator expert")
            )
        novice = trainer.encode("novice", sampler.matching_batch())
        trainer.step_encoder(self.distance(expert.flatten(0, 1), novice.flatten(0, 1)))


class GradientReversal(Hook):
    """The adversary within Algorithm 1: the encoders feel its gradient reversed (Ganin and Lempitsky, 2015).

    Args:
        weight: of the reversed gradient.
    """

    def __init__(self, weight: float) -> None:
        self.weight = weight

    def auxiliary_loss(self, trainer: Trainer, latents: Mapping[str, Tensor]) -> Tensor:
        """Equation (2) for A on a batch's latents; of only one system there is nothing to tell apart."""
        trainer.discrimination.zero_grad()
        if len(latents) < 2:
            return next(iter(latents.values())).new_zeros(())
        # The value is the latents', the derivative by them is -weight.
        turned = {
            role: (1 + self.weight) * latents[role].detach()
            - self.weight * latents[role]
            for role in ("expert", "novice")
        }
        # unequal numbers
        terms = [
            one_sided_loss(**{name: one})
            for name, one in trainer.discriminate(turned).items()
        ]
        return torch.stack(terms).sum()

    def after_step(self, trainer: Trainer) -> None:
        """A takes its step, too."""
        trainer.discrimination.step()

    def regularise(self, trainer: Trainer) -> bool:
        """Algorithm 1 has done it."""
        return True
