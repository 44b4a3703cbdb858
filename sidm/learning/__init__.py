"""The method: what the networks see, the networks, their losses, training and evaluation; without PyBullet."""

from typing import TYPE_CHECKING

from sidm.lazy import on_demand

if TYPE_CHECKING:
    from sidm.learning.checkpoint import CheckpointError
    from sidm.learning.dataset import Datasets, Motion, load_motion, novice_split, prepare
    from sidm.learning.evaluation import rollout, rollout_errors, validation_loss
    from sidm.learning.model import DynamicsModel
    from sidm.learning.networks import SIDM, Decoder, Discriminator, Encoder, parameter_count
    from sidm.learning.observation import encode_inputs, integrate, robot_centred_map, transition
    from sidm.learning.settings import PAPER_NETWORK, RELEASED_NETWORK, Network, Training
    from sidm.learning.training import Tested, Trained, TrainingError, train
    from sidm.learning.units import Standardisation

__all__ = [
    "CheckpointError", "Datasets", "Decoder", "Discriminator", "DynamicsModel", "Encoder", "Motion", "Network",
    "PAPER_NETWORK", "RELEASED_NETWORK", "SIDM", "Standardisation", "Tested", "Trained", "Training", "TrainingError",
    "encode_inputs", "integrate", "load_motion", "novice_split", "parameter_count", "prepare", "robot_centred_map",
    "rollout", "rollout_errors", "train", "transition", "validation_loss",
]  # fmt: skip

on_demand(
    __name__,
    checkpoint="CheckpointError",
    dataset="Datasets Motion load_motion novice_split prepare",
    evaluation="rollout rollout_errors validation_loss",
    model="DynamicsModel",
    networks="SIDM Decoder Discriminator Encoder parameter_count",
    observation="encode_inputs integrate robot_centred_map transition",
    settings="PAPER_NETWORK RELEASED_NETWORK Network Training",
    training="Tested Trained TrainingError train",
    units="Standardisation",
)
