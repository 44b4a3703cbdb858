"""M trials at once on one device: what fills a GPU that a single training leaves idle."""

from companion.bundle.seat import Run
from companion.bundle.training import ONLY, SHARED, Ended, train_bundle

__all__ = ["ONLY", "SHARED", "Ended", "Run", "train_bundle"]
