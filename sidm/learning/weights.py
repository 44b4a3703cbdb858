"""A model's weights: how they are initialised, and the optimiser that changes them.

The paper does not say how weights are initialised. 'scaled' weights keep the variance
of signals from layer to layer. With PyTorch's defaults signals shrink in every layer,
most in the LSTM, and the map's thousands of features hide the encoder's few other
inputs; for some hundreds of batches the loss then does not fall.
"""

from __future__ import annotations

import math

import torch
from torch import nn

from sidm.settings import Training


def scale_layers(module: nn.Module, slope: float) -> None:
    """He's normal weights before leaky ReLUs keep signals' variance; biases of 0."""
    for layer in module.modules():
        if isinstance(layer, (nn.Linear, nn.Conv2d)):
            nn.init.kaiming_normal_(layer.weight, a=slope)
            nn.init.zeros_(layer.get_parameter("bias"))


def scale_last(layer: nn.Module) -> None:
    """Set Glorot's uniform weights in a network's last dense layer, not its biases."""
    nn.init.xavier_uniform_(layer.get_parameter("weight"))


@torch.no_grad()
def scale_columns(layer: nn.Module, columns: slice, slope: float) -> None:
    """Set He's weights in the `columns` of a dense layer as if it had no other inputs.

    The other inputs, which are many, then do not hide these.
    """
    part = layer.get_parameter("weight")[:, columns]
    part.normal_(0.0, math.sqrt(2 / (1 + slope**2) / part.shape[1]))


@torch.no_grad()
def scale_recurrence(lstm: nn.LSTM) -> None:
    """Set an LSTM's weights gate by gate: Glorot's for inputs, orthogonal for states.

    Biases are 0, but those of the forget gates are 1, which opens these gates.
    """
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


def trainable_parameters(module: nn.Module) -> list[nn.Parameter]:
    """The parameters of a module that are not frozen."""
    return [parameter for parameter in module.parameters() if parameter.requires_grad]


def make_optimiser(module: nn.Module, training: Training) -> torch.optim.Optimizer:
    """Adam with decoupled weight decay (section 4), or the released L2 penalty."""
    adam = torch.optim.AdamW if training.decay == "decoupled" else torch.optim.Adam
    return adam(
        trainable_parameters(module),
        lr=training.learning_rate,
        weight_decay=training.weight_decay,
        fused=True,
    )
