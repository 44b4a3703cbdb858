"""Measures of how alike two systems' latent state-actions are, and of what each system's parts do for the other."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch
from scipy.spatial.distance import cdist
from sklearn.base import ClassifierMixin
from sklearn.decomposition import PCA
from sklearn.neural_network import MLPClassifier
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from torch import Tensor

from sidm.learning.dataset import Windows
from sidm.learning.evaluation import EVALUATION_BATCH
from sidm.learning.losses import prediction_loss
from sidm.learning.model import DynamicsModel

EVERY = 4  # steps; those between are much like their neighbours
PICTURED = 150  # latents of each system
MMD_SAMPLES = 1000  # of each system, at most


def latents_of(model: DynamicsModel, role: str, motion: Windows) -> np.ndarray:
    """Latent state-actions (N, T / EVERY, 128) of trajectories."""
    found: list[Tensor] = []
    with torch.inference_mode():
        for part in motion.split(EVALUATION_BATCH):
            found.append(
                model.encoders[role](part.inputs[:, ::EVERY], part.maps[:, ::EVERY])
            )
    return torch.cat(found).double().numpy()


def crossed_loss(
    model: DynamicsModel, motion: Windows, encoder: str, decoder: str
) -> float:
    """Equation (1) averaged over the steps of `motion`, through one system's encoder and one system's decoder.

    Only robots whose states, actions and transitions mean the same can be asked so, as
    the paper's can.
    """
    total = 0.0
    with torch.inference_mode():
        for part in motion.split(EVALUATION_BATCH):
            transitions, _ = model.sidm(model.encoders[encoder](part.inputs, part.maps))
            total += float(
                prediction_loss(model.decoders[decoder](transitions), part.targets)
                .double()
                .sum()
            )
    return total / motion.targets[..., 0].numel()


def small_network() -> MLPClassifier:
    """A classifier with one hidden layer, not yet fitted."""
    return MLPClassifier((64,), early_stopping=True, max_iter=300, random_state=0)


def told_apart(features: Sequence[np.ndarray], classifier: ClassifierMixin) -> float:
    """Share of steps, both systems weighing the same, that a classifier fitted on half of the trajectories tells apart.

    Args:
        features: (N, T, K) of the novice's trajectories and (M, T, K) of the expert's.
        classifier: unfitted.
    """
    halves = [[motion[0::2], motion[1::2]] for motion in features]
    fitted = make_pipeline(StandardScaler(), classifier)
    fitted.fit(*_labelled(halves[0][0], halves[1][0]))
    right = [
        np.mean(fitted.predict(half[1].reshape(-1, half[1].shape[-1])) == label)
        for label, half in enumerate(halves)
    ]
    return float(np.mean(right))


def squared_mmd(novice: np.ndarray, expert: np.ndarray) -> float:
    """Unbiased squared maximum mean discrepancy of two sets of features (., ., K), in units of their common spread."""
    x, y = _spread(novice, expert, MMD_SAMPLES)
    distances = [
        cdist(one, other, "sqeuclidean") for one, other in ((x, x), (y, y), (x, y))
    ]
    width = np.median(distances[2])
    within_x, within_y, across = (np.exp(-distance / width) for distance in distances)
    n, m = len(x), len(y)
    within = (within_x.sum() - n) / (n * (n - 1)) + (within_y.sum() - m) / (m * (m - 1))
    return float(within - 2 * across.mean())


def picture(
    novice: np.ndarray, expert: np.ndarray
) -> list[tuple[tuple[float, float], ...]]:
    """PICTURED of each system's latents (., ., K), (x, y) each, along the first two principal components of both."""
    parts = _spread(novice, expert, PICTURED)
    flat = PCA(2, svd_solver="full").fit(np.concatenate(parts))
    return [
        tuple((float(x), float(y)) for x, y in flat.transform(part)) for part in parts
    ]


def _labelled(novice: np.ndarray, expert: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    flat = [motion.reshape(-1, motion.shape[-1]) for motion in (novice, expert)]
    return np.concatenate(flat), np.repeat([0, 1], [len(part) for part in flat])


def _spread(novice: np.ndarray, expert: np.ndarray, most: int) -> list[np.ndarray]:
    """At most `most` features (., K) of each system, standardised together."""
    both, labels = _labelled(novice, expert)
    both, draw = StandardScaler().fit_transform(both), np.random.default_rng(0)
    return [draw.permutation(both[labels == label])[:most] for label in (0, 1)]
