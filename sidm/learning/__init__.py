"""The paper's method: observations, networks, losses, training and evaluation.

It does without PyBullet. A public name is imported when first used: who reads stored
curves, as of `stopping`, does without PyTorch.
"""

from sidm.lazy import public

#: Module -> its public names.
_MODULES = {
    "sidm.settings": "PAPER_NETWORK RELEASED_NETWORK Network Training",
    "sidm.learning.networks": "SIDM Decoder Discriminator Encoder parameter_count",
    "sidm.learning.checkpoint": "CheckpointError",
    "sidm.learning.stopping": "CurvePoint TrainingError",
    "sidm.learning.training": "Trained train",
    "sidm.learning.dataset": "Datasets Windows windows_of",
    "sidm.learning.model": "DynamicsModel",
    "sidm.learning.units": "Standardisation",
    "sidm.learning.observation": "encode_inputs integrate robot_centred_map transition",
    "sidm.shards": "novice_split",
    "sidm.learning.evaluation": "rollout rollout_errors validation_loss",
}
__all__, __getattr__, __dir__ = public(__name__, _MODULES)
