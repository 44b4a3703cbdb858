"""The released code's choices against a plain implementation, for a few iterations.

`PlainRecipe` is written from the facts alone: one optimiser that behaves as PyTorch did
in 2020 (gradients stay and are set to 0), L2 decay in the gradient, one system an
iteration, a discriminator that processes one system at a time.
"""

import dataclasses

import pytest
import torch
import torch.nn.functional as F

from sidm.config import ConfigError
from sidm.learning import Standardisation, Training
from sidm.learning.resuming import Checkpoint
from sidm.learning.trainer import Trainer
from sidm.learning.training import prediction_phase, regularisation_phase, train
from tests.sidm.learning.test_other_bodies import TRACKED
from tests.sidm.learning.test_reference import decoded, encoded, remembered

RECIPE = dict(
    p_expert=0.5,
    batch=2,
    discriminator_batch=2,
    matching_batch=2,
    prediction_iterations=5,
    test_interval=10**6,
    learning_rate=1e-3,
    weight_decay=0.05,
    decay="l2",
    system_draw="iteration",
    matching_optimiser="shared",
    reduction="mean",
    units="raw",
    zero_gradients=True,
    replacement=False,
    discriminator_draw="one",
)


class PlainAdam:
    """Adam with L2 decay.

    A weight that never had a gradient stays; one that had a gradient moves in every
    step.
    """

    def __init__(self, weights, rate, decay):
        self.weights, self.rate, self.decay, self.state = weights, rate, decay, {}

    @torch.no_grad()
    def step(self, gradients) -> None:
        for name, weight in self.weights.items():
            if gradients.get(name) is None and name not in self.state:
                continue
            gradient = gradients.get(name)
            gradient = (
                torch.zeros_like(weight) if gradient is None else gradient
            ) + self.decay * weight
            count, mean, square = self.state.get(
                name, (0, torch.zeros_like(weight), torch.zeros_like(weight))
            )
            count, mean, square = (
                count + 1,
                0.9 * mean + 0.1 * gradient,
                0.999 * square + 0.001 * gradient**2,
            )
            self.state[name] = count, mean, square
            weight -= (
                self.rate
                * (mean / (1 - 0.9**count))
                / ((square / (1 - 0.999**count)).sqrt() + 1e-8)
            )


class PlainRecipe:
    """A phase of prediction, discriminator and matching.

    It uses what an equal Trainer draws.
    """

    def __init__(self, trainer: Trainer) -> None:
        self.trainer, training = trainer, trainer.training
        self.weights = {
            n: weights.detach().clone().requires_grad_()
            for n, weights in trainer.model.named_parameters()
        }
        self.critic = {
            n: tensor.detach().clone().requires_grad_()
            for n, tensor in trainer.discriminator.named_parameters()
        }
        units = Standardisation.none()._asdict()
        self.buffers = {
            f"{part}.{role}.{name}": units[name]
            for role in ("novice", "expert")
            for part, names in (
                ("encoders", ("input_mean", "input_std", "map_mean", "map_std")),
                ("decoders", ("target_mean", "target_std")),
            )
            for name in names
        }
        self.adam = PlainAdam(
            self.weights, training.learning_rate, training.weight_decay
        )
        self.critics_adam = PlainAdam(
            self.critic, training.learning_rate, training.weight_decay
        )

    def latents(self, role, batch):
        values = self.weights | self.buffers
        return torch.stack(
            [
                encoded(values, role, x, m)
                for x, m in zip(batch.inputs, batch.maps, strict=True)
            ]
        )

    def log_odds(self, latents):
        hidden = F.leaky_relu(
            latents @ self.critic["dense.0.weight"].T + self.critic["dense.0.bias"],
            0.01,
        )
        return hidden @ self.critic["dense.2.weight"].T + self.critic["dense.2.bias"]

    def descend(self, adam, loss, of) -> None:
        gradients = torch.autograd.grad(loss, list(of.values()), allow_unused=True)
        adam.step(dict(zip(of, gradients, strict=True)))

    def predict(self) -> None:
        ((role, batch),) = self.trainer.sampler.batch().items()  # one system
        values = self.weights | self.buffers
        parts = [
            remembered(values, latents, self.trainer.network.layers)
            for latents in self.latents(role, batch)
        ]
        pairs = zip(parts, batch.targets, strict=True)
        squares = torch.stack(
            [(decoded(values, role, one) - y) ** 2 for one, y in pairs]
        )
        # over the 13 components, too
        self.descend(self.adam, squares.mean(), self.weights)

    def discriminate(self) -> None:
        of_expert = bool(
            torch.rand(
                1, generator=self.trainer.sampler.generators["discriminated system"]
            )
            < 0.5
        )
        role = "expert" if of_expert else "novice"
        odds = self.log_odds(
            self.latents(role, self.trainer.sampler.draw(role, 2, "")).detach()
        )
        loss = -torch.log(
            torch.sigmoid(odds) if of_expert else 1 - torch.sigmoid(odds)
        ).mean()
        self.descend(self.critics_adam, loss, self.critic)

    def match(self) -> None:
        odds = self.log_odds(
            self.latents("novice", self.trainer.sampler.draw("novice", 2, ""))
        )
        encoder = {
            name: one
            for name, one in self.weights.items()
            if name.startswith("encoders.novice.")
        }
        self.descend(self.adam, -torch.log(torch.sigmoid(odds)).mean(), encoder)

    def phases(self) -> None:
        training = self.trainer.training
        for step, count in (
            (self.predict, training.prediction_iterations),
            (self.discriminate, training.discriminator_iterations),
            (self.match, training.matching_iterations),
        ):
            for _ in range(count):
                step()


def compare(model, plain, names, rel=3e-4):
    """Compare all weights.

    Adam divides by the size of a gradient, so rounding of small gradients shows.
    """
    for name in names:
        weights, expected = (
            dict(model.named_parameters())[name].detach(),
            plain[name].detach(),
        )
        assert torch.allclose(
            weights, expected, rtol=0, atol=rel * expected.abs().max().item()
        ), name


def test_two_rounds_of_all_phases_are_the_plain_ones(make_trainer):
    trainer, plain = make_trainer(**RECIPE), PlainRecipe(make_trainer(**RECIPE))
    for _ in range(2):
        prediction_phase(trainer)
        regularisation_phase(trainer)
        plain.phases()
        compare(trainer.model, plain.weights, plain.weights)
        compare(trainer.discriminator, plain.critic, plain.critic)


@pytest.mark.parametrize(
    "other",
    [
        dict(zero_gradients=False),
        dict(units="standardised"),
        dict(discriminator_draw="both"),
        dict(replacement=True),
        dict(decay="decoupled"),
        dict(matching_optimiser="own"),
        dict(reduction="sum"),
    ],
    ids=str,
)
def test_each_choice_makes_a_difference(make_trainer, other):
    """Without a difference, the comparison above could not fail."""
    ends = []
    for changes in (RECIPE, RECIPE | other):
        trainer = make_trainer(**changes)
        for _ in range(2):
            prediction_phase(trainer)
            regularisation_phase(trainer)
        ends.append(
            torch.cat(
                [weights.detach().flatten() for weights in trainer.model.parameters()]
            )
        )
    assert (ends[0] - ends[1]).abs().max() > 2e-3


def test_momentum_and_decay_move_parts_without_a_gradient(make_trainer):
    """Matching steps move the expert's parts, too, once they have had a gradient.

    Before that they stay.
    """
    trainer = make_trainer(**RECIPE | {"p_expert": 0.0, "prediction_iterations": 1})
    expert = [
        name for name, _ in trainer.model.named_parameters() if ".expert." in name
    ]
    prediction_phase(trainer)
    before = trainer.weights()
    regularisation_phase(trainer)
    after = trainer.weights()
    moved = {name for name in after if not torch.equal(after[name], before[name])}
    assert moved and not moved & set(expert)
    trainer = make_trainer(**RECIPE | {"p_expert": 1.0, "prediction_iterations": 1})
    prediction_phase(trainer)
    before = trainer.weights()
    regularisation_phase(trainer)
    after = trainer.weights()
    assert all(
        not torch.equal(after[name], before[name])
        for name in (*expert, "sidm.output.0.weight")
    )


def test_a_restored_training_moves_them_as_one_that_went_on(make_trainer, tmp_path):
    first, second = make_trainer(**RECIPE), make_trainer(**RECIPE)
    prediction_phase(first)
    Checkpoint(tmp_path).save(first)
    assert Checkpoint(tmp_path).restore(second)
    for trainer in (first, second):
        regularisation_phase(trainer)
        prediction_phase(trainer)
    for name, weights in first.weights().items():
        assert torch.equal(weights, second.weights()[name]), name


def test_draws_without_replacement_go_through_all(make_trainer):
    trainer = make_trainer(**RECIPE)
    count = len(trainer.datasets.train)
    purposes = ("novice", "matching", "x") * count
    drawn = torch.cat(
        [trainer.sampler.indices("novice", 2, purpose) for purpose in purposes]
    )
    for order in drawn.split(count):
        assert sorted(order.tolist()) == list(range(count))
    assert not torch.equal(*drawn.split(count)[:2])


def test_without_replacement_nothing_is_drawn_in_vain(make_trainer):
    """Batches of the other system do not use up a system's order."""
    trainer = make_trainer(**RECIPE)
    seen = {"novice": [], "expert": []}
    for _ in range(60):
        for role, which in trainer.sampler.batch_indices().items():
            seen[role] += which.tolist()
    for role, drawn in seen.items():
        count = len(trainer.sampler.windows[role])
        assert len(drawn) > 2 * count
        for start in range(0, len(drawn) - count, count):
            assert sorted(drawn[start : start + count]) == list(range(count))


def test_one_system_for_the_discriminator_is_either(make_trainer):
    trainer = make_trainer(**RECIPE)
    drawn = [trainer.sampler.discriminator_systems() for _ in range(400)]
    assert set(drawn) == {("expert",), ("novice",)}
    assert 160 < drawn.count(("expert",)) < 240


def test_raw_units_are_every_methods(datasets, small_network, small_training):
    """Raw units hold also where units are given, as for a correction."""
    raw = dataclasses.replace(small_training, units="raw", max_samples=24)
    trained = train(
        datasets,
        small_network,
        raw,
        0,
        standardisation=Standardisation.fit(datasets.expert),
    )
    for name, buffer in trained.model.named_buffers():
        assert torch.equal(
            buffer,
            torch.ones_like(buffer)
            if name.endswith("_std")
            else torch.zeros_like(buffer),
        )


def test_raw_units_leave_nothing_to_weigh_a_loss_by(datasets, small_network):
    network = dataclasses.replace(small_network, novice_body=TRACKED)
    alone = Training(units="raw", p_expert=0.0, regularise=False)
    with pytest.raises(
        ConfigError,
        match="Training.units='raw' leaves 'tracked' no variance to weigh its loss by",
    ):
        Trainer(datasets, network, alone, 0)
