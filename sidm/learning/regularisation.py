"""Algorithm 2: the novice's encoder learns to give latents like the expert's, by the paper's adversary or otherwise."""

from __future__ import annotations

from collections.abc import Callable

import torch
from torch import Tensor

from sidm.learning.learner import Learner
from sidm.learning.losses import coral, expected_discriminator_loss, expected_matching_loss, mmd, one_sided_loss


def regularise_phase(learner: Learner) -> None:
    """Algorithm 2: the discriminator learns to tell the systems' latents apart, then E_n learns to deceive it."""
    training = learner.training
    if training.matching == "adversary":
        for _ in range(training.discriminator_iterations):
            discriminator_iteration(learner)
    for _ in range(training.matching_iterations):
        matching_iteration(learner) if training.matching == "adversary" else distance_iteration(learner)


def discriminator_iteration(learner: Learner) -> None:
    """One update of A alone, equation (2)."""
    count, roles = learner.training.discriminator_batch, learner.draw_discriminated()
    batch = {role: learner.draw(role, count, f"discriminator {role}") for role in roles}
    with torch.no_grad():
        latents = {role: learner.encode(role, motion) for role, motion in batch.items()}
    learner.discrimination.zero_grad()
    logits = discriminate(learner, latents)
    loss = expected_discriminator_loss(**logits) if len(logits) > 1 else one_sided_loss(**logits)
    loss.backward()
    learner.discrimination.step()


def discriminate(learner: Learner, latents: dict[str, Tensor]) -> dict[str, Tensor]:
    """The logits (b, T) that A gives latents (b, T, 128), by '<system>_logits'; notes how many A tells apart."""
    logits = {role: learner.discriminator.logits(one) for role, one in latents.items()}
    right = torch.cat([one.flatten() > 0 if role == "expert" else one.flatten() < 0 for role, one in logits.items()])
    learner.accuracy = float(right.float().mean())
    return {f"{role}_logits": one for role, one in logits.items()}


def matching_iteration(learner: Learner) -> None:
    """One update of E_n alone, equation (4)."""
    novice = learner.draw("novice", learner.training.matching_batch, "matching")
    update_encoder(learner, expected_matching_loss(learner.discriminator.logits(learner.encode("novice", novice))))


def update_encoder(learner: Learner, loss: Tensor) -> None:
    """One step of E_n alone down the gradient of `loss`."""
    learner.clear_gradients()  # of all parts, since a shared optimiser steps those that have one
    loss.backward(inputs=list(learner.model.encoders["novice"].parameters()))
    learner.matching.step()


#: Distances between the distributions of latents (N, K) and (M, K), by the setting that chooses them.
DISTANCES: dict[str, Callable[[Tensor, Tensor], Tensor]] = {"mmd": mmd, "coral": coral}


def distance_iteration(learner: Learner) -> None:
    """One update of E_n alone by a distance between its latents and those of E_e, in place of equation (4)."""
    count = learner.training.matching_batch
    with torch.no_grad():
        expert = learner.encode("expert", learner.draw("expert", count, "discriminator expert"))
    novice = learner.encode("novice", learner.draw("novice", count, "matching"))
    distance = DISTANCES[learner.training.matching]
    update_encoder(learner, distance(expert.flatten(0, 1), novice.flatten(0, 1)))


def reversed_loss(learner: Learner, latents: dict[str, Tensor]) -> Tensor:
    """Equation (2) for A, while the encoders feel its gradient reversed (Ganin and Lempitsky, 2015).

    Args:
        learner: with `reversal_weight`, of the reversed gradient.
        latents: (b, T, 128) of a batch, by system; of only one system there is nothing to tell apart.
    """
    if len(latents) < 2:
        return next(iter(latents.values())).new_zeros(())
    weight = learner.training.reversal_weight
    # The value is the latents', the derivative by them is -weight.
    expert, novice = ((1 + weight) * latents[role].detach() - weight * latents[role] for role in ("expert", "novice"))
    logits = discriminate(learner, {"expert": expert, "novice": novice})
    terms = [one_sided_loss(**{name: one}) for name, one in logits.items()]  # of unequal numbers
    return torch.stack(terms).sum()
