"""Both algorithms against a plain implementation.

It follows the formulas, with default layouts, one step at a time.
"""

import pytest
import torch
import torch.nn.functional as F
from torch import Tensor

from sidm.learning.trainer import Trainer
from sidm.learning.training import prediction_phase, regularisation_phase

ITERATIONS = 12
Weights = dict[str, Tensor]


def encoded(weights: Weights, role: str, inputs: Tensor, maps: Tensor) -> Tensor:
    """Latent state-actions (T, latent) of a trajectory.

    Inputs are (T, 11), maps (T, P, P).
    """
    part = {
        name.removeprefix(f"encoders.{role}."): tensor
        for name, tensor in weights.items()
    }
    hidden = ((maps.float() - part["map_mean"]) / part["map_std"])[:, None]
    for layer in ("convolutions.0", "convolutions.2"):
        kernel = part[f"{layer}.weight"].contiguous(
            memory_format=torch.contiguous_format
        )
        hidden = F.leaky_relu(F.conv2d(hidden, kernel, part[f"{layer}.bias"]), 0.01)
    numbers = (inputs - part["input_mean"]) / part["input_std"]
    hidden = torch.cat(
        [hidden.permute(0, 2, 3, 1).reshape(len(hidden), -1), numbers], dim=1
    )
    for layer in ("dense.0", "dense.2"):
        hidden = F.leaky_relu(
            hidden @ part[f"{layer}.weight"].T + part[f"{layer}.bias"], 0.01
        )
    return hidden


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
    hidden = (
        torch.stack(rows) @ weights["sidm.output.0.weight"].T
        + weights["sidm.output.0.bias"]
    )
    return F.leaky_relu(hidden, 0.01)


def decoded(weights: Weights, role: str, transitions: Tensor) -> Tensor:
    """State transitions (T, 13), raw units."""
    part = {
        name.removeprefix(f"decoders.{role}."): tensor
        for name, tensor in weights.items()
    }
    hidden = F.leaky_relu(
        transitions @ part["dense.0.weight"].T + part["dense.0.bias"], 0.01
    )
    return part["target_mean"] + part["target_std"] * (
        hidden @ part["dense.2.weight"].T + part["dense.2.bias"]
    )


def probability(weights: Weights, latents: Tensor) -> Tensor:
    """Probability A(x), (T,), that latents (T, latent) are the expert's."""
    hidden = F.leaky_relu(
        latents @ weights["dense.0.weight"].T + weights["dense.0.bias"], 0.01
    )
    return torch.sigmoid(
        hidden @ weights["dense.2.weight"].T + weights["dense.2.bias"]
    )[:, 0]


class Adam:
    """Adam with decoupled weight decay, after Loshchilov and Hutter (2019).

    It moves weights that have a gradient.
    """

    def __init__(self, weights: Weights, rate: float, decay: float) -> None:
        self.weights, self.rate, self.decay = weights, rate, decay
        self.moments = {
            name: (0, torch.zeros_like(w), torch.zeros_like(w))
            for name, w in weights.items()
        }

    def step(self, loss: Tensor) -> None:
        gradients = torch.autograd.grad(
            loss, list(self.weights.values()), allow_unused=True
        )
        with torch.no_grad():
            for name, gradient in zip(self.weights, gradients, strict=True):
                if gradient is not None:
                    count, mean, square = self.moments[name]
                    count, mean, square = (
                        count + 1,
                        0.9 * mean + 0.1 * gradient,
                        0.999 * square + 0.001 * gradient**2,
                    )
                    self.moments[name] = count, mean, square
                    self.weights[name] *= 1 - self.rate * self.decay
                    scale = (square / (1 - 0.999**count)).sqrt() + 1e-8
                    self.weights[name] -= self.rate * (mean / (1 - 0.9**count)) / scale


class Plain:
    """Algorithms 1 and 2 on the batches that a trainer's sampler draws."""

    def __init__(self, trainer: Trainer) -> None:
        self.sampler = trainer.sampler
        self.training = trainer.training
        self.layers = trainer.network.layers
        self.buffers = {
            name: tensor.clone() for name, tensor in trainer.model.named_buffers()
        }
        self.weights = {
            name: weights.detach().clone().requires_grad_()
            for name, weights in trainer.model.named_parameters()
        }
        self.adversary = {
            name: one.detach().clone().requires_grad_()
            for name, one in trainer.discriminator.named_parameters()
        }
        how = self.training.learning_rate, self.training.weight_decay
        encoder = {
            name: weight
            for name, weight in self.weights.items()
            if name.startswith("encoders.novice.")
        }
        self.prediction = Adam(self.weights, *how)
        self.discrimination = Adam(self.adversary, *how)
        self.matching = Adam(encoder, *how)

    def latents(self, role: str, windows) -> list[Tensor]:
        values = self.weights | self.buffers
        return [
            encoded(values, role, *one)
            for one in zip(windows.inputs, windows.maps, strict=True)
        ]

    def predict(self) -> float:
        """Run an iteration of Algorithm 1: one step down equation (1).

        Returns the batch's mean loss before the step.
        """
        values, losses = self.weights | self.buffers, []
        for role, windows in self.sampler.batch().items():
            for latents, targets in zip(
                self.latents(role, windows), windows.targets, strict=True
            ):
                predicted = decoded(
                    values, role, remembered(values, latents, self.layers)
                )
                losses.append(((predicted - targets) ** 2).sum(dim=1))
        loss = torch.cat(losses).mean()
        self.prediction.step(loss)
        return float(loss.detach())

    def discriminate(self) -> None:
        """Run an iteration of Algorithm 2's first half: A steps down equation (2)."""
        batch = self.sampler.discriminator_batch()
        probabilities = {
            role: torch.cat(
                [
                    probability(self.adversary, one.detach())
                    for one in self.latents(role, windows)
                ]
            )
            for role, windows in batch.items()
        }
        self.discrimination.step(
            (
                -probabilities["expert"].log() - (1 - probabilities["novice"]).log()
            ).mean()
        )

    def match(self) -> None:
        """Run an iteration of Algorithm 2's second half: E_n descends equation (4)."""
        latents = self.latents("novice", self.sampler.matching_batch())
        self.matching.step(
            -torch.cat([probability(self.adversary, latent) for latent in latents])
            .log()
            .mean()
        )


def test_equation_1_is_the_plain_one(make_trainer):
    """`DynamicsModel.loss` of one system equals the plain loss.

    So do the losses of a batch, which the SIDM processes at once.
    """
    trainer = make_trainer(p_expert=0.5, batch=8)
    plain, batch = Plain(trainer), trainer.sampler.batch()
    values = plain.weights | plain.buffers
    latents = {role: trainer.encode(role, windows) for role, windows in batch.items()}
    together = trainer.model.losses(batch, latents)
    assert set(batch) == {"novice", "expert"}
    for role, windows in batch.items():
        expected = [
            (
                (decoded(values, role, remembered(values, one, plain.layers)) - targets)
                ** 2
            ).sum(1)
            for one, targets in zip(
                plain.latents(role, windows), windows.targets, strict=True
            )
        ]
        for found in (trainer.model.loss(role, windows), together[role]):
            assert torch.allclose(found, torch.stack(expected), rtol=1e-4, atol=1e-6)


def test_training_is_the_plain_one(make_trainer):
    options = dict(
        p_expert=0.5,
        batch=3,
        prediction_iterations=1,
        test_interval=10**6,
        learning_rate=1e-3,
    )
    ours, plain = make_trainer(**options), Plain(make_trainer(**options))
    probe = make_trainer(**options)
    for _ in range(ITERATIONS):
        probe.model.load_state_dict(ours.model.state_dict())
        with torch.no_grad():
            batch = probe.sampler.batch()
            before = torch.cat(
                [
                    probe.model.loss(role, windows).flatten()
                    for role, windows in batch.items()
                ]
            ).mean()
        prediction_phase(ours)
        assert float(before) == pytest.approx(plain.predict(), rel=1e-4)


def test_a_phase_of_each_algorithm_is_the_plain_one(make_trainer):
    """All weights agree after a phase of Algorithm 1 and one of Algorithm 2."""
    options = dict(
        p_expert=0.5,
        batch=3,
        prediction_iterations=4,
        discriminator_iterations=3,
        matching_iterations=3,
        test_interval=10**6,
        learning_rate=1e-3,
    )
    ours, plain = make_trainer(**options), Plain(make_trainer(**options))
    before = {
        name: weights.detach().clone()
        for name, weights in ours.model.named_parameters()
    }
    prediction_phase(ours)
    regularisation_phase(ours)
    for work, count in ((plain.predict, 4), (plain.discriminate, 3), (plain.match, 3)):
        for _ in range(count):
            work()
    for name, one in ours.model.named_parameters():
        moved = float((one.detach() - before[name]).abs().max())
        assert float((one - plain.weights[name]).detach().abs().max()) < 0.02 * moved, (
            name
        )
    for name, one in ours.discriminator.named_parameters():
        assert torch.allclose(one, plain.adversary[name], atol=2e-5), name
