"""The losses and both algorithms against a plain implementation.

The plain one follows the formulas, with default layouts, one step at a time. The
released code has one optimiser that behaves as PyTorch did in 2020 (gradients stay and
are set to 0), L2 decay in the gradient, one system an iteration, and a discriminator
that processes one system at a time.
"""

import math

import pytest
import torch
import torch.nn.functional as F
from torch import Tensor

from sidm.learning import Training, losses
from sidm.learning.trainer import Trainer
from sidm.learning.training import prediction_phase, regularisation_phase

Weights = dict[str, Tensor]
PAPER = dict(p_expert=0.5, test_interval=10**6)
RELEASED = PAPER | dict(
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


def copied(weights) -> Weights:
    return {name: one.detach().clone().requires_grad_() for name, one in weights}


def dense(weights: Weights, name: str, values: Tensor) -> Tensor:
    return values @ weights[f"{name}.weight"].T + weights[f"{name}.bias"]


def leaky(values: Tensor) -> Tensor:
    return F.leaky_relu(values, 0.01)


def part_of(weights: Weights, start: str) -> Weights:
    return {
        name.removeprefix(start): tensor
        for name, tensor in weights.items()
        if name.startswith(start)
    }


def encoded(weights: Weights, role: str, inputs: Tensor, maps: Tensor) -> Tensor:
    """Latent state-actions (T, latent) of inputs (T, 11) and maps (T, P, P)."""
    part = part_of(weights, f"encoders.{role}.")
    hidden = ((maps.float() - part["map_mean"]) / part["map_std"])[:, None]
    for layer in ("convolutions.0", "convolutions.2"):
        kernel = part[f"{layer}.weight"].contiguous()
        hidden = leaky(F.conv2d(hidden, kernel, part[f"{layer}.bias"]))
    numbers = (inputs - part["input_mean"]) / part["input_std"]
    features = hidden.permute(0, 2, 3, 1).reshape(len(hidden), -1)
    hidden = torch.cat([features, numbers], dim=1)
    return leaky(dense(part, "dense.2", leaky(dense(part, "dense.0", hidden))))


def remembered(weights: Weights, latents: Tensor, layers: int) -> Tensor:
    """Latent state transitions (T, 64) of latents (T, latent).

    LSTM cells run step by step, then the output layer.
    """
    rows = list(latents)
    for layer in range(layers):
        inward, back, first, second = (
            weights[f"sidm.lstm.{name}_l{layer}"]
            for name in ("weight_ih", "weight_hh", "bias_ih", "bias_hh")
        )
        output, cell = torch.zeros(back.shape[1]), torch.zeros(back.shape[1])
        for step, row in enumerate(rows):
            gates = inward @ row + first + back @ output + second
            take, forget, new, give = gates.chunk(4)
            cell = torch.sigmoid(forget) * cell + torch.sigmoid(take) * torch.tanh(new)
            output = torch.sigmoid(give) * torch.tanh(cell)
            rows[step] = output
    return leaky(dense(weights, "sidm.output.0", torch.stack(rows)))


def decoded(weights: Weights, role: str, transitions: Tensor) -> Tensor:
    """State transitions (T, 13), raw units."""
    part = part_of(weights, f"decoders.{role}.")
    hidden = dense(part, "dense.2", leaky(dense(part, "dense.0", transitions)))
    return part["target_mean"] + part["target_std"] * hidden


def probability(weights: Weights, latents: Tensor) -> Tensor:
    """Probability A(x) that latents (..., latent) are the expert's."""
    return torch.sigmoid(
        dense(weights, "dense.2", leaky(dense(weights, "dense.0", latents)))
    )


class Adam:
    """Adam after Kingma and Ba (2015), with decoupled or L2 decay.

    It moves weights that have a gradient; in the released form also weights that had
    one before.
    """

    def __init__(self, weights: Weights, training: Training) -> None:
        self.weights, self.training = weights, training
        self.moments: dict[str, tuple] = {}

    def step(self, loss: Tensor, of: Weights) -> None:
        rate, decay = self.training.learning_rate, self.training.weight_decay
        found = torch.autograd.grad(loss, list(of.values()), allow_unused=True)
        gradients = dict(zip(of, found, strict=True))
        with torch.no_grad():
            for name, weight in self.weights.items():
                gradient, zero = gradients.get(name), torch.zeros_like(weight)
                if gradient is None:
                    if not self.training.zero_gradients or name not in self.moments:
                        continue
                    gradient = zero
                if self.training.decay == "l2":
                    gradient = gradient + decay * weight
                else:
                    weight *= 1 - rate * decay
                count, mean, square = self.moments.get(name, (0, zero, zero))
                count, mean = count + 1, 0.9 * mean + 0.1 * gradient
                square = 0.999 * square + 0.001 * gradient**2
                self.moments[name] = count, mean, square
                scale = (square / (1 - 0.999**count)).sqrt() + 1e-8
                weight -= rate * (mean / (1 - 0.9**count)) / scale


class Plain:
    """Algorithms 1 and 2 on the batches that a trainer's sampler draws."""

    def __init__(self, trainer: Trainer) -> None:
        self.sampler, self.training = trainer.sampler, trainer.training
        self.layers = trainer.network.layers
        self.buffers = dict(trainer.model.named_buffers())
        self.weights = copied(trainer.model.named_parameters())
        self.adversary = copied(trainer.discriminator.named_parameters())
        self.encoder = {
            name: weight
            for name, weight in self.weights.items()
            if name.startswith("encoders.novice.")
        }
        self.prediction = self.matching = Adam(self.weights, self.training)
        if self.training.matching_optimiser == "own":
            self.matching = Adam(self.encoder, self.training)
        self.discrimination = Adam(self.adversary, self.training)

    def latents(self, role: str, windows) -> list[Tensor]:
        values = self.weights | self.buffers
        pairs = zip(windows.inputs, windows.maps, strict=True)
        return [encoded(values, role, *pair) for pair in pairs]

    def predict(self) -> None:
        """Run an iteration of Algorithm 1: one step down equation (1)."""
        values, squares = self.weights | self.buffers, []
        for role, windows in self.sampler.batch().items():
            latents = self.latents(role, windows)
            for latent, targets in zip(latents, windows.targets, strict=True):
                transitions = remembered(values, latent, self.layers)
                squares.append((decoded(values, role, transitions) - targets) ** 2)
        loss = torch.stack(squares).mean()
        if self.training.reduction == "sum":  # over the 13 components
            loss = 13 * loss
        self.prediction.step(loss, self.weights)

    def discriminate(self) -> None:
        """Run an iteration of Algorithm 2's first half: A steps down equation (2)."""
        loss = torch.zeros(())
        for role, windows in self.sampler.discriminator_batch().items():
            latents = torch.stack(self.latents(role, windows)).detach()
            of_expert = probability(self.adversary, latents)
            right = of_expert if role == "expert" else 1 - of_expert
            loss = loss - right.log().mean()
        self.discrimination.step(loss, self.adversary)

    def match(self) -> float:
        """Run an iteration of Algorithm 2's second half: E_n descends equation (4)."""
        latents = torch.stack(self.latents("novice", self.sampler.matching_batch()))
        loss = -probability(self.adversary, latents).log().mean()
        self.matching.step(loss, self.encoder)
        return float(loss.detach())

    def phases(self) -> None:
        for work, count in (
            (self.predict, self.training.prediction_iterations),
            (self.discriminate, self.training.discriminator_iterations),
            (self.match, self.training.matching_iterations),
        ):
            found = [work() for _ in range(count)]
        self.matching_loss = sum(found) / len(found)


@pytest.mark.parametrize("recipe", [PAPER, RELEASED], ids=["paper", "released"])
def test_two_rounds_of_all_phases_are_the_plain_ones(make_trainer, recipe):
    """Adam divides by the size of a gradient, so rounding of small gradients shows."""
    trainer, plain = make_trainer(**recipe), Plain(make_trainer(**recipe))
    if recipe is RELEASED:  # in raw units
        for name, buffer in plain.buffers.items():
            assert buffer.unique() == (1 if name.endswith("_std") else 0), name
    for _ in range(2):
        prediction_phase(trainer)
        regularisation_phase(trainer)
        plain.phases()
        assert trainer.matching_loss == pytest.approx(plain.matching_loss, rel=1e-4)
        for module, weights in (
            (trainer.model, plain.weights),
            (trainer.discriminator, plain.adversary),
        ):
            for name, found in module.named_parameters():
                error = (found - weights[name]).abs().max()
                assert error <= 3e-4 * weights[name].abs().max(), name


def test_released_draws_go_through_all_windows_and_take_either_system(make_trainer):
    """Batches of the other system do not use up a system's order."""
    trainer = make_trainer(**RELEASED)
    seen: dict[str, list[int]] = {"novice": [], "expert": []}
    for _ in range(60):
        for role, which in trainer.sampler.batch_indices().items():
            seen[role] += which.tolist()
    for role, drawn in seen.items():
        count = len(trainer.sampler.windows[role])
        assert len(drawn) > 2 * count and drawn[:count] != drawn[count : 2 * count]
        for start in range(0, len(drawn) - count, count):
            assert sorted(drawn[start : start + count]) == list(range(count))
    drawn = [trainer.sampler.discriminator_systems() for _ in range(400)]
    assert set(drawn) == {("expert",), ("novice",)}
    assert 160 < drawn.count(("expert",)) < 240


def test_prediction_loss_is_the_squared_norm():
    target = torch.zeros(2, 3, 13)
    predicted = target.clone()
    predicted[0, 0, 0], predicted[0, 0, 12], predicted[1, 2, 5] = 3.0, 4.0, -2.0
    expected = [[25.0, 0.0, 0.0], [0.0, 0.0, 4.0]]
    assert losses.prediction_loss(predicted, target).tolist() == expected
    with pytest.raises(ValueError, match=r"\(2, 3, 13\) and target \(3, 13\)"):
        losses.prediction_loss(predicted, target[0])


def test_discriminator_and_matching_losses_from_probabilities():
    expert = torch.logit(torch.tensor([0.9, 0.5], dtype=torch.float64))
    novice = torch.logit(torch.tensor([0.2, 0.7], dtype=torch.float64))
    of_expert, of_novice = math.log(0.9 * 0.5) / 2, math.log(0.8 * 0.3) / 2
    both = losses.expected_discriminator_loss(expert, novice)
    assert float(both) == pytest.approx(-of_expert - of_novice)
    assert float(losses.one_sided_loss(expert)) == pytest.approx(-of_expert)
    one_sided = losses.one_sided_loss(novice_logits=novice)
    assert float(one_sided) == pytest.approx(-of_novice)
    matching = losses.expected_matching_loss(novice)
    assert float(matching) == pytest.approx(-math.log(0.2 * 0.7) / 2)
    far = torch.tensor([200.0])  # where the probability rounds
    assert losses.discriminator_loss(-far, far).item() == pytest.approx(400.0)
    assert losses.matching_loss(-far).item() == pytest.approx(200.0)
