"""Substitutes of the paper's adversary: distribution distances, gradient reversal."""

import numpy as np
import pytest
import torch

from companion.beyond.matching import (
    DISTANCES,
    DistanceMatching,
    GradientReversal,
    coral,
    mmd,
)
from sidm.learning.training import prediction_phase, regularisation_phase


def encoded(trainer):
    """Latents of a batch, by system."""
    return {
        role: trainer.encode(role, windows)
        for role, windows in trainer.sampler.batch().items()
    }


def test_distances_grow_with_the_shift(generator):
    first, second = torch.randn(2, 300, 5, generator=generator)
    for distance in DISTANCES.values():
        distances = [
            float(distance(first, second + shift)) for shift in (0.0, 0.5, 2.0)
        ]
        assert distances == sorted(distances) and distances[2] > 5 * distances[0]
        assert float(distance(first, first)) == pytest.approx(0.0, abs=1e-6)
        assert float(distance(first, second)) == pytest.approx(
            float(distance(second, first)), rel=1e-4
        )


def test_mmd_is_its_double_sum(generator):
    first = torch.randn(4, 3, generator=generator)
    second = torch.randn(5, 3, generator=generator) + 1
    both = torch.cat([first, second]).double().numpy()
    squares = ((both[:, None] - both[None]) ** 2).sum(-1)
    unit = np.sort(squares.ravel())[(squares.size - 1) // 2]
    signs = np.array([1 / 4] * 4 + [-1 / 5] * 5)
    total = (
        sum(signs @ np.exp(-squares / (width * unit)) @ signs for width in (0.5, 1, 2))
        / 3
    )
    assert float(mmd(first, second)) == pytest.approx(total, rel=1e-4)


def test_coral_sees_covariance_and_mean(generator):
    first = torch.randn(2000, 3, generator=generator)
    assert float(coral(first, 2 * first)) == pytest.approx(
        float(9 * torch.cov(first.T).square().mean()), rel=0.05
    )
    assert float(coral(first, first + 2)) == pytest.approx(4.0, rel=1e-3)


@pytest.mark.parametrize("matching", sorted(DISTANCES))
def test_a_distance_changes_the_novices_encoder_alone_and_shrinks(
    make_trainer, matching
):
    trainer = make_trainer(matching=matching, matching_batch=6, learning_rate=3e-3)
    before = trainer.weights()

    def distance() -> float:
        sides = [trainer.datasets.expert, trainer.datasets.train]
        with torch.no_grad():
            latents = [
                trainer.encode(r, m).flatten(0, 1)
                for r, m in zip(("expert", "novice"), sides, strict=True)
            ]
        return float(DISTANCES[matching](*latents))

    first, hook = distance(), DistanceMatching(matching)
    for _ in range(60):
        hook.iteration(trainer)
    changed = {
        name
        for name, tensor in trainer.weights().items()
        if not torch.equal(tensor, before[name])
    }
    assert changed and all(name.startswith("encoders.novice.") for name in changed)
    assert distance() < 0.6 * first


def test_a_distance_needs_no_discriminator(make_trainer):
    trainer = make_trainer(matching="mmd")
    before = [p.clone() for p in trainer.discriminator.parameters()]
    regularisation_phase(trainer)
    assert all(
        torch.equal(one, p)
        for one, p in zip(before, trainer.discriminator.parameters(), strict=True)
    )
    assert trainer.accuracy is None


def test_the_encoders_feel_the_discriminators_gradient_reversed(make_trainer):
    trainer = make_trainer(
        matching="reversal", reversal_weight=0.3, p_expert=0.5, batch=8
    )
    latents = encoded(trainer)
    plain = {
        role: latent.detach().clone().requires_grad_()
        for role, latent in latents.items()
    }
    turned = {
        role: one.detach().clone().requires_grad_() for role, one in latents.items()
    }
    logits = {role: trainer.discriminator.logits(one) for role, one in plain.items()}
    loss = GradientReversal(0.3).auxiliary_loss(trainer, turned)
    loss.backward()
    of_discriminator = [p.grad.clone() for p in trainer.discriminator.parameters()]
    trainer.discriminator.zero_grad()
    torch.nn.functional.softplus(-logits["expert"]).mean().backward(retain_graph=True)
    torch.nn.functional.softplus(logits["novice"]).mean().backward()
    for role in plain:
        assert torch.allclose(turned[role].grad, -0.3 * plain[role].grad, atol=1e-7)
    for one, parameter in zip(
        of_discriminator, trainer.discriminator.parameters(), strict=True
    ):
        assert torch.allclose(one, parameter.grad, atol=1e-7)
    softplus = torch.nn.functional.softplus
    expected = softplus(-logits["expert"]).mean() + softplus(logits["novice"]).mean()
    assert loss.item() == pytest.approx(expected.item())


def test_reversal_teaches_the_discriminator_within_algorithm_1(make_trainer):
    trainer = make_trainer(matching="reversal", p_expert=0.5)
    before = [p.clone() for p in trainer.discriminator.parameters()]
    prediction_phase(trainer)
    assert any(
        not torch.equal(one, p)
        for one, p in zip(before, trainer.discriminator.parameters(), strict=True)
    )
    assert 0 <= trainer.accuracy <= 1


def test_a_batch_of_one_system_has_nothing_to_tell_apart(make_trainer):
    trainer = make_trainer(matching="reversal", p_expert=1.0)
    assert float(GradientReversal(0.1).auxiliary_loss(trainer, encoded(trainer))) == 0.0
