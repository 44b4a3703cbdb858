"""Parts of a training, before any update, give the figures of today's versions."""

import numpy as np
import pytest
import torch

from companion.extensions.trainer import coral, mmd
from sidm.learning import losses
from sidm.learning.dataset import windows_of
from sidm.learning.evaluation import validation_loss
from sidm.learning.model import DynamicsModel
from sidm.learning.networks import Discriminator
from sidm.learning.units import Standardisation
from sidm.settings import PAPER_NETWORK, Network

CLOSE = dict(rel=1e-4, abs=1e-6)  # float32 sums of some thousand terms


def samples(rows: int, columns: int, shift: float = 0.0) -> torch.Tensor:
    """Numbers (rows, columns) that are the same on every processor."""
    angles = np.arange(rows * columns, dtype=float) * 1.7 + shift
    return torch.tensor(np.sin(angles).reshape(rows, columns)).float()


def test_every_loss_comes_to_its_figures(golden):
    first, second = samples(40, 13), samples(40, 13, 0.4) + 0.2
    figures = {
        "prediction": float(losses.prediction_loss(first, second).mean()),
        "discriminator": float(losses.expected_discriminator_loss(first, second)),
        "matching": float(losses.expected_matching_loss(first)),
        "mmd": float(mmd(first, second)),
        "coral": float(coral(first, second)),
    }
    golden.hold("losses", "training", figures, **CLOSE)


@pytest.mark.parametrize(
    ("name", "changes"),
    [
        ("scaled weights", {}),
        ("PyTorch's weights", {"initialisation": "pytorch"}),
        ("the paper's layers", {"layers": PAPER_NETWORK.layers}),
    ],
)
def test_fresh_networks_come_to_their_figures(golden, make_trajectories, name, changes):
    """Losses are by component, logits are the discriminator's."""
    network = Network(pixels=16, hidden=32, **changes)
    motion = windows_of(make_trajectories(3), network.pixels)
    model = DynamicsModel(network, Standardisation.fit(motion), seed=0)
    with torch.no_grad():
        latents = model.encoders["novice"](motion.inputs, motion.maps)
    torch.manual_seed(0)
    figures = {
        "component_losses": validation_loss(model, motion).tolist(),
        "latents": float(latents.square().mean()),
        "logits": float(Discriminator(network).logits(latents).detach().mean()),
        "maps": float(motion.maps.float().square().mean()),
    }
    golden.hold(name, "training", figures, **CLOSE)
