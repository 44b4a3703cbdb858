"""Prediction training held against a plain implementation: from the formulas, default layouts, one step at a time."""

import pytest
import torch
import torch.nn.functional as F
from torch import Tensor

from sidm.learning.learner import Learner
from sidm.learning.training import batch_losses, encode_batch, predict_phase

ITERATIONS = 12


def losses_of(learner: Learner, batch) -> dict[str, Tensor]:
    return batch_losses(learner, batch, encode_batch(learner, batch))


def encoded(weights: dict[str, Tensor], role: str, inputs: Tensor, maps: Tensor) -> Tensor:
    """Latent state-actions (T, latent) of one trajectory, inputs (T, 11) and maps (T, P, P)."""
    part = {name.removeprefix(f"encoders.{role}."): tensor for name, tensor in weights.items()}
    hidden = ((maps.float() - part["map_mean"]) / part["map_std"])[:, None]
    for layer in ("convolutions.0", "convolutions.2"):
        kernel = part[f"{layer}.weight"].contiguous(memory_format=torch.contiguous_format)
        hidden = F.leaky_relu(F.conv2d(hidden, kernel, part[f"{layer}.bias"]), 0.01)
    numbers = (inputs - part["input_mean"]) / part["input_std"]
    hidden = torch.cat([hidden.permute(0, 2, 3, 1).reshape(len(hidden), -1), numbers], dim=1)
    for layer in ("dense.0", "dense.2"):
        hidden = F.leaky_relu(hidden @ part[f"{layer}.weight"].T + part[f"{layer}.bias"], 0.01)
    return hidden


def remembered(weights: dict[str, Tensor], latents: Tensor, layers: int) -> Tensor:
    """Latent state transitions (T, 64) of latents (T, latent): LSTM cells step by step, then the output layer."""
    rows = list(latents)
    for layer in range(layers):
        inward, back, first, second = (weights[f"sidm.lstm.{name}_l{layer}"]
                                       for name in ("weight_ih", "weight_hh", "bias_ih", "bias_hh"))  # fmt: skip
        output, cell = torch.zeros(back.shape[1]), torch.zeros(back.shape[1])
        for step, row in enumerate(rows):
            gates = inward @ row + first + back @ output + second
            take, forget, new, give = gates.chunk(4)
            cell = torch.sigmoid(forget) * cell + torch.sigmoid(take) * torch.tanh(new)
            output = torch.sigmoid(give) * torch.tanh(cell)
            rows[step] = output
    hidden = torch.stack(rows) @ weights["sidm.output.0.weight"].T + weights["sidm.output.0.bias"]
    return F.leaky_relu(hidden, 0.01)


def decoded(weights: dict[str, Tensor], role: str, transitions: Tensor) -> Tensor:
    """State transitions (T, 13), raw units."""
    part = {name.removeprefix(f"decoders.{role}."): tensor for name, tensor in weights.items()}
    hidden = F.leaky_relu(transitions @ part["dense.0.weight"].T + part["dense.0.bias"], 0.01)
    return part["target_mean"] + part["target_std"] * (hidden @ part["dense.2.weight"].T + part["dense.2.bias"])


class PlainTraining:
    """Algorithm 1 on the batches that a Learner draws: equation (1), Adam with decoupled weight decay."""

    def __init__(self, learner: Learner) -> None:
        self.learner, self.training = learner, learner.training
        self.buffers = {name: tensor.clone() for name, tensor in learner.model.named_buffers()}
        self.weights = {name: one.detach().clone().requires_grad_() for name, one in learner.model.named_parameters()}
        self.moments = {name: (0, torch.zeros_like(w), torch.zeros_like(w)) for name, w in self.weights.items()}

    def iterate(self) -> float:
        """One update; the mean loss before it."""
        values, layers, losses = self.weights | self.buffers, self.learner.network.layers, []
        for role, motion in self.learner.draw_batch().items():
            for inputs, targets, maps in zip(motion.inputs, motion.targets, motion.maps, strict=True):
                transitions = remembered(values, encoded(values, role, inputs, maps), layers)
                losses += [((decoded(values, role, transitions) - targets) ** 2).sum(dim=1)]
        loss = torch.cat(losses).mean()
        gradients = torch.autograd.grad(loss, list(self.weights.values()), allow_unused=True)
        with torch.no_grad():
            for name, gradient in zip(self.weights, gradients, strict=True):
                if gradient is not None:
                    self._step(name, gradient)
        return float(loss.detach())

    def _step(self, name: str, gradient: Tensor) -> None:
        count, mean, square = self.moments[name]
        count, mean, square = count + 1, 0.9 * mean + 0.1 * gradient, 0.999 * square + 0.001 * gradient**2
        self.moments[name] = count, mean, square
        rate, weight = self.training.learning_rate, self.weights[name]
        weight *= 1 - rate * self.training.weight_decay
        weight -= rate * (mean / (1 - 0.9**count)) / ((square / (1 - 0.999**count)).sqrt() + 1e-8)


def test_training_is_the_plain_one(make_learner):
    options = dict(p_expert=0.5, batch=3, prediction_iterations=1, test_interval=10**6, learning_rate=1e-3)
    ours, plain = make_learner(**options), PlainTraining(make_learner(**options))
    probe = make_learner(**options)
    for _ in range(ITERATIONS):
        probe.model.load_state_dict(ours.model.state_dict())
        with torch.no_grad():
            before = torch.cat([part.flatten() for part in losses_of(probe, probe.draw_batch()).values()]).mean()
        predict_phase(ours)
        assert float(before) == pytest.approx(plain.iterate(), rel=1e-4)
