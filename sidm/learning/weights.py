"""A model's weights: how they begin, and the optimiser that moves them.

The paper names no initial weights. The scaled ones carry the inputs through the layers
at their own scale: with PyTorch's defaults a signal shrinks in every layer, most of all
in an LSTM's, and an encoder's few numbers are lost beside its map's thousands. The loss
then stands still until some hundreds of batches have made the weights grow.
"""

from __future__ import annotations

import math

import torch
from torch import nn

from sidm.settings import Training


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
    return adam(
        learnt(module),
        lr=training.learning_rate,
        weight_decay=training.weight_decay,
        fused=True,
    )
