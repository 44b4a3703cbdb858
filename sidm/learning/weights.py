"""A model's weights: how they begin, and what happens to them at an update.

The paper names no initial weights. The scaled ones carry the inputs through the layers at their own scale: with
PyTorch's defaults a signal shrinks in every layer, most of all in an LSTM's, and an encoder's few numbers are lost
beside its map's thousands. The loss then stands still until some hundreds of batches have made the weights grow.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterator

import torch
from torch import Tensor, nn

from sidm.settings import Training

WARM_UP = 10  # updates; an average of n has no more of the past than n / (n + WARM_UP)


def scale_layers(module: nn.Module, slope: float) -> None:
    """He's normal weights for the layers before leaky ReLUs of a `slope`, biases of 0: signals keep their variance."""
    for layer in module.modules():
        if isinstance(layer, (nn.Linear, nn.Conv2d)):
            nn.init.kaiming_normal_(layer.weight, a=slope)
            nn.init.zeros_(layer.get_parameter("bias"))


def scale_last(layer: nn.Module) -> None:
    """Glorot's uniform weights for a dense layer that nothing follows; its biases are left alone."""
    nn.init.xavier_uniform_(layer.get_parameter("weight"))


@torch.no_grad()
def scale_columns(layer: nn.Module, columns: slice, slope: float) -> None:
    """He's weights in some columns, as if a dense layer had these inputs alone: the others do not drown them."""
    part = layer.get_parameter("weight")[:, columns]
    part.normal_(0.0, math.sqrt(2 / (1 + slope**2) / part.shape[1]))


@torch.no_grad()
def scale_recurrence(lstm: nn.LSTM) -> None:
    """Glorot's weights from the inputs, orthogonal ones from the state, gate by gate; forget gates open (bias 1)."""
    for name, parameter in lstm.named_parameters():
        gates = parameter.chunk(4)  # input, forget, cell, output
        for gate in gates:
            if name.startswith("weight_ih"):
                nn.init.xavier_uniform_(gate)
            elif name.startswith("weight_hh"):
                nn.init.orthogonal_(gate)
            else:
                nn.init.zeros_(gate)
        if name.startswith("bias_ih"):
            nn.init.ones_(gates[1])


def learnt(module: nn.Module) -> list[nn.Parameter]:
    """The parameters of a module that are not frozen."""
    return [parameter for parameter in module.parameters() if parameter.requires_grad]


def make_optimiser(module: nn.Module, training: Training) -> torch.optim.Optimizer:
    """Adam with decoupled weight decay (section 4), or with the released code's L2 penalty."""
    adam = torch.optim.AdamW if training.decay == "decoupled" else torch.optim.Adam
    return adam(learnt(module), lr=training.learning_rate, weight_decay=training.weight_decay, fused=True)


class Follower:
    """What follows each step of the prediction's optimiser, as `Training.tether` and `Training.averaging` ask for it.

    The pull toward the starting point is that of Li, Grandvalet and Davoine (2018), apart from the gradient as
    decoupled weight decay is.
    """

    def __init__(self, module: nn.Module, training: Training):
        """`module` has its initial weights."""
        self.weights = [parameter.data for parameter in learnt(module)]
        self.pull = training.learning_rate * training.tether
        self.past = training.averaging
        self.anchor = [weight.clone() for weight in self.weights] if self.pull else []
        self.average = [weight.clone() for weight in self.weights] if self.past else []
        self.updates = 0

    def follow(self) -> None:
        """After an update."""
        if self.anchor:
            torch._foreach_lerp_(self.weights, self.anchor, self.pull)
        if self.average:
            self.updates += 1
            past = min(self.past, self.updates / (self.updates + WARM_UP))
            torch._foreach_lerp_(self.average, self.weights, 1 - past)

    @contextlib.contextmanager
    def averaged(self) -> Iterator[None]:
        """The module has the averaged weights inside the block, where an average is taken."""
        kept = [weight.clone() for weight in self.weights] if self.average else []
        for weights, inside in zip(self.weights, self.average, strict=False):
            weights.copy_(inside)
        try:
            yield
        finally:
            for weights, before in zip(self.weights, kept, strict=False):
                weights.copy_(before)

    def tensors(self) -> dict[str, Tensor]:
        """What a checkpoint has to keep, by name: the averages, in the weights' shapes."""
        return {str(number): tensor for number, tensor in enumerate(self.average)}

    def restore(self, tensors: dict[str, Tensor], updates: int) -> None:
        """Put back what `tensors` gave, after so many updates."""
        for number, tensor in tensors.items():
            self.average[int(number)].copy_(tensor)
        self.updates = updates
