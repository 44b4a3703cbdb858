"""M trials at once on one device: a single training leaves most of a GPU idle."""

from companion.bundle.bundled_trial import Run
from companion.bundle.training import SHARED, Ended, train_bundle

__all__ = ["SHARED", "Ended", "Run", "train_bundle"]
