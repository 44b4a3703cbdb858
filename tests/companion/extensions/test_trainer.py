"""Additions to the training loop: distances, reversal, mirror images, weights."""

import numpy as np
import pytest
import torch
from torch.nn.functional import softplus

from companion.extensions.trainer import (
    DISTANCES,
    WARM_UP,
    coral,
    mirrored,
    mmd,
)
from sidm.learning import Windows, encode_inputs, robot_centred_map, transition
from sidm.learning.evaluation import mean_loss
from sidm.learning.training import prediction_phase


def encoded(trainer):
    """Latents of a batch, by system."""
    return trainer.model.latents(trainer.sampler.batch())


def test_mmd_is_its_double_sum(generator):
    first = torch.randn(4, 3, generator=generator)
    second = torch.randn(5, 3, generator=generator) + 1
    both = torch.cat([first, second]).double().numpy()
    squares = ((both[:, None] - both[None]) ** 2).sum(-1)
    unit = np.sort(squares.ravel())[(squares.size - 1) // 2]
    signs = np.array([1 / 4] * 4 + [-1 / 5] * 5)
    total = sum(signs @ np.exp(-squares / (w * unit)) @ signs for w in (0.5, 1, 2)) / 3
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
    sizes = {"matching_batch": 6, "matching_iterations": 60, "learning_rate": 3e-3}
    trainer = make_trainer(matching=matching, **sizes)
    before = trainer.weights()
    sides = {"expert": trainer.datasets.expert, "novice": trainer.datasets.train}

    def distance() -> float:
        with torch.no_grad():
            latents = trainer.model.latents(sides).values()
        return float(DISTANCES[matching](*(one.flatten(0, 1) for one in latents)))

    first = distance()
    assert trainer.regularise()
    after = trainer.weights()
    changed = {name for name in after if not torch.equal(after[name], before[name])}
    assert changed and all(name.startswith("encoders.novice.") for name in changed)
    assert distance() < 0.6 * first


def test_the_encoders_feel_the_discriminators_gradient_reversed(make_trainer):
    trainer = make_trainer(
        matching="reversal", reversal_weight=0.3, p_expert=0.5, batch=8
    )
    weights = [*trainer.discriminator.parameters()]
    first = weights[0].detach().clone()
    latents = encoded(trainer)
    plain, turned = (
        {role: one.detach().clone().requires_grad_() for role, one in latents.items()}
        for _ in range(2)
    )
    loss = trainer.reversal_loss(turned)
    loss.backward()
    of_discriminator = [p.grad.clone() for p in weights]
    trainer.discriminator.zero_grad()
    logits = {role: trainer.discriminator.logits(one) for role, one in plain.items()}
    expected = softplus(-logits["expert"]).mean() + softplus(logits["novice"]).mean()
    expected.backward()
    assert loss.item() == pytest.approx(expected.item())
    for role in plain:
        assert torch.allclose(turned[role].grad, -0.3 * plain[role].grad, atol=1e-7)
    for one, weight in zip(of_discriminator, weights, strict=True):
        assert torch.allclose(one, weight.grad, atol=1e-7)
    prediction_phase(trainer)  # which trains the discriminator, too
    assert not torch.equal(weights[0], first) and trainer.accuracy is not None
    alone = {"expert": latents["expert"]}  # nothing to tell apart
    assert float(trainer.reversal_loss(alone)) == 0.0


def test_a_mirrored_motion_is_that_of_the_reflected_world(make_trajectories):
    """Inputs, transitions and maps follow from geometry, without the table of signs."""
    (drive,) = make_trajectories(1)
    signs = torch.tensor([1, -1, 1, -1, 1, -1, 1, 1, -1, 1, -1, 1, -1.0]).double()

    def motion(reflect: bool) -> Windows:
        states = torch.tensor(drive.states).double()
        actions = torch.tensor(drive.actions).double()
        heights = drive.ground.heights
        if reflect:  # y becomes -y
            states, actions = states * signs, actions * torch.tensor([1, -1])
            heights = heights[::-1].copy()
        maps = robot_centred_map(heights, states[:-1], 8)
        inputs = encode_inputs(states[:-1], actions)
        return Windows(
            inputs[None], transition(states[:-1], states[1:])[None], maps[None]
        )

    reflected, expected = mirrored(motion(False), torch.tensor([True])), motion(True)
    assert torch.allclose(reflected.inputs, expected.inputs, atol=1e-9)
    assert torch.allclose(reflected.targets, expected.targets, atol=1e-9)
    # the two triangles of a cell meet on the other diagonal in the mirror image
    error = float((reflected.maps - expected.maps).abs().max())
    assert error < 0.1 < float(np.ptp(expected.maps.numpy()))


def test_only_the_chosen_trajectories_turn_and_twice_is_back(make_motion):
    motion, which = make_motion(4), torch.tensor([True, False, True, False])
    once = mirrored(motion, which)
    for name in ("inputs", "targets", "maps"):
        sides = motion, once, mirrored(once, which)
        before, one, two = (getattr(side, name) for side in sides)
        assert torch.equal(one[1::2], before[1::2]) and torch.equal(two, before)
        assert not torch.equal(one[0], before[0])


def test_mirror_images_are_drawn_in_pairs_and_leave_the_other_draws(make_trainer):
    """A novice's trajectory is mirrored in batches with and without an expert's."""
    settings = {"regularise": False, "batch": 8}
    alone, both = (
        make_trainer(p_expert=p, mirror=True, **settings) for p in (0.0, 0.5)
    )
    plain = make_trainer(p_expert=0.0, **settings)
    images = 0
    for _ in range(10):
        one, other, unturned = (
            trainer.sampler.batch_indices()["novice"].tolist()
            for trainer in (alone, both, plain)
        )
        assert 0 < len(other) < 8 and all(place in one for place in other)
        # the mirror images of six trajectories have the numbers from 6 on
        assert [place % 6 for place in one] == unturned
        images += sum(place >= 6 for place in one)
    assert 20 < images < 60  # of 80


def test_the_pull_is_a_share_of_the_way_back(make_trainer):
    trainer = make_trainer(learning_rate=0.01, tether=10.0)
    weight = trainer.model.sidm.output[0].weight
    weight.data += 2.0
    moved = weight.detach().clone()
    trainer.pull_to_start()
    assert torch.allclose(weight, moved - 0.2, atol=1e-6)


def test_the_average_is_that_of_its_formula(make_trainer):
    """Early, the past has at most the weight n / (n + WARM_UP)."""
    trainer = make_trainer(averaging=0.9)
    weight = trainer.model.sidm.output[0].weight
    expected = weight.detach().clone()
    for number in range(1, 200):
        weight.data += 0.1
        trainer.update_average(number)
        past = min(0.9, number / (number + WARM_UP))
        expected = past * expected + (1 - past) * weight.detach()
    after = weight.detach().clone()
    with trainer.averaged():
        assert torch.allclose(weight, expected, atol=1e-4)
        assert not torch.allclose(weight, after, atol=0.1)
    assert torch.equal(weight, after)


def test_tests_see_the_average_and_training_goes_on_without_it(make_trainer):
    trainer, plain = make_trainer(averaging=0.5), make_trainer()
    for one in (trainer, plain):
        prediction_phase(one)
    weights = plain.weights()
    assert all(torch.equal(p, weights[name]) for name, p in trainer.weights().items())
    trainer.run_test()
    raw = mean_loss(trainer.model, trainer.test)
    with trainer.averaged():
        averaged = mean_loss(trainer.model, trainer.test)
    assert trainer.history[-1].test_loss == averaged != raw
