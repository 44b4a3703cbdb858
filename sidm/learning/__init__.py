"""The paper's method: observations, networks, losses, training and evaluation.

It does without PyBullet. A public name is imported when first used: who reads stored
curves, as of `stopping`, does without PyTorch.
"""

import importlib
from typing import Any

#: Public name -> its module.
_MODULES = {
    "PAPER_NETWORK": "settings",
    "RELEASED_NETWORK": "settings",
    "SIDM": "learning.networks",
    "CheckpointError": "learning.checkpoint",
    "CurvePoint": "learning.training",
    "Datasets": "learning.dataset",
    "Decoder": "learning.networks",
    "Discriminator": "learning.networks",
    "DynamicsModel": "learning.model",
    "Encoder": "learning.networks",
    "Network": "settings",
    "Standardisation": "learning.units",
    "Trained": "learning.training",
    "Training": "settings",
    "TrainingError": "learning.training",
    "Windows": "learning.dataset",
    "encode_inputs": "learning.observation",
    "integrate": "learning.observation",
    "load_windows": "learning.dataset",
    "novice_split": "shards",
    "parameter_count": "learning.networks",
    "robot_centred_map": "learning.observation",
    "rollout": "learning.evaluation",
    "rollout_errors": "learning.evaluation",
    "train": "learning.training",
    "transition": "learning.observation",
    "validation_loss": "learning.evaluation",
    "windows_of": "learning.dataset",
}
__all__ = [*_MODULES]  # noqa: PLE0604


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module 'sidm.learning' has no attribute '{name}'")
    module = importlib.import_module(f"sidm.{_MODULES[name]}")
    value = globals()[name] = getattr(module, name)
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
