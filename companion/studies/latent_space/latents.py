"""Measures of how alike the latent state-actions of two systems are.

`crossed_loss` also measures what an encoder or decoder of one system does for the
other system.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import torch
from scipy.spatial.distance import cdist
from sklearn.base import ClassifierMixin
from sklearn.decomposition import PCA
from sklearn.neural_network import MLPClassifier
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from sidm.learning.dataset import Windows
from sidm.learning.evaluation import EVALUATION_BATCH
from sidm.learning.losses import prediction_loss
from sidm.learning.model import DynamicsModel

STRIDE = 4  # steps from one latent to the next; neighbours are much alike
PICTURED = 150  # latents of each system in a picture
MMD_SAMPLES = 1000  # latents of each system in the discrepancy, at most


def latents_of(model: DynamicsModel, role: str, motion: Windows) -> np.ndarray:
    """Latent state-actions (N, T / STRIDE, 128) of N trajectories."""
    with torch.inference_mode():
        latents = [
            model.encoders[role](part.inputs[:, ::STRIDE], part.maps[:, ::STRIDE])
            for part in motion.split(EVALUATION_BATCH)
        ]
    return torch.cat(latents).double().numpy()


def crossed_loss(
    model: DynamicsModel, motion: Windows, encoder: str, decoder: str
) -> float:
    """Equation (1) with the encoder and decoder of any role, averaged over all steps.

    This needs robots whose states, actions and transitions mean the same, as those of
    the paper do.
    """
    total = 0.0
    with torch.inference_mode():
        for part in motion.split(EVALUATION_BATCH):
            latents = model.encoders[encoder](part.inputs, part.maps)
            predicted = model.decoders[decoder](model.sidm(latents)[0])
            total += float(prediction_loss(predicted, part.targets).double().sum())
    return total / motion.targets[..., 0].numel()


def small_network() -> MLPClassifier:
    """A classifier with one hidden layer, not yet fitted."""
    return MLPClassifier((64,), early_stopping=True, max_iter=300, random_state=0)


def classifier_accuracy(
    features: Sequence[np.ndarray], classifier: ClassifierMixin
) -> float:
    """Accuracy with which a classifier tells the systems of unseen steps apart.

    The classifier is fitted on half of the trajectories, (N, T, K) of the novice and
    (M, T, K) of the expert, and tested on the other half. Both systems weigh the same;
    0.5 is chance.
    """
    fitted = make_pipeline(StandardScaler(), classifier)
    fitted.fit(*_labelled([motion[0::2] for motion in features]))
    unseen, labels = _labelled([motion[1::2] for motion in features])
    right = fitted.predict(unseen) == labels
    return float(np.mean([right[labels == label].mean() for label in (0, 1)]))


def squared_mmd(novice: np.ndarray, expert: np.ndarray) -> float:
    """Unbiased squared maximum mean discrepancy of two sets of features (., ., K).

    Features are standardised over both systems; the kernel is Gaussian, as wide as the
    median distance.
    """
    x, y = _sampled(novice, expert, MMD_SAMPLES)
    distances = [cdist(a, b, "sqeuclidean") for a, b in ((x, x), (y, y), (x, y))]
    width = np.median(distances[2])
    within_x, within_y, across = (np.exp(-distance / width) for distance in distances)
    n, m = len(x), len(y)
    within = (within_x.sum() - n) / (n * (n - 1)) + (within_y.sum() - m) / (m * (m - 1))
    return float(within - 2 * across.mean())


def picture(novice: np.ndarray, expert: np.ndarray) -> list[Any]:
    """First two principal components, lists (PICTURED, 2), of both systems' latents."""
    parts = _sampled(novice, expert, PICTURED)
    pca = PCA(2, svd_solver="full").fit(np.concatenate(parts))
    return [pca.transform(part).tolist() for part in parts]


def _labelled(motions: Sequence[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """The features (., K) of both systems and their labels: novice 0, expert 1."""
    flat = [motion.reshape(-1, motion.shape[-1]) for motion in motions]
    return np.concatenate(flat), np.repeat([0, 1], [len(part) for part in flat])


def _sampled(novice: np.ndarray, expert: np.ndarray, most: int) -> list[np.ndarray]:
    """At most `most` random features (., K) of each system, standardised together."""
    both, labels = _labelled((novice, expert))
    both, rng = StandardScaler().fit_transform(both), np.random.default_rng(0)
    return [rng.permutation(both[labels == label])[:most] for label in (0, 1)]
