"""The paper's method: observations, networks, losses, training and evaluation.

It does without PyBullet.
"""

from sidm.learning.checkpoint import CheckpointError
from sidm.learning.dataset import (
    Datasets,
    Windows,
    load_windows,
    novice_split,
    windows_of,
)
from sidm.learning.evaluation import rollout, rollout_errors, validation_loss
from sidm.learning.model import DynamicsModel
from sidm.learning.networks import (
    SIDM,
    Decoder,
    Discriminator,
    Encoder,
    parameter_count,
)
from sidm.learning.observation import (
    encode_inputs,
    integrate,
    robot_centred_map,
    transition,
)
from sidm.learning.training import CurvePoint, Trained, TrainingError, train
from sidm.learning.units import Standardisation
from sidm.settings import PAPER_NETWORK, RELEASED_NETWORK, Network, Training

__all__ = [
    "PAPER_NETWORK",
    "RELEASED_NETWORK",
    "SIDM",
    "CheckpointError",
    "CurvePoint",
    "Datasets",
    "Decoder",
    "Discriminator",
    "DynamicsModel",
    "Encoder",
    "Network",
    "Standardisation",
    "Trained",
    "Training",
    "TrainingError",
    "Windows",
    "encode_inputs",
    "integrate",
    "load_windows",
    "novice_split",
    "parameter_count",
    "robot_centred_map",
    "rollout",
    "rollout_errors",
    "train",
    "transition",
    "validation_loss",
    "windows_of",
]
