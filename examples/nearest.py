"""A method for the benchmark: what followed the most similar moment.

companion bench examples/nearest.py:Nearest --tasks quick
"""

import numpy as np
import torch

from sidm.learning.observation import transition


class Nearest:
    """One nearest neighbour among the novice's steps."""

    def fit(self, novice, expert, seed):
        """Keep the novice's steps; the expert's are not used."""
        numbers = np.concatenate([self.numbers(drive) for drive in novice])
        self.scale = numbers.std(0) + 1e-9
        self.known = numbers / self.scale
        after = [torch.from_numpy(drive.states).double() for drive in novice]
        body = novice[0].body
        self.followed = torch.cat([transition(s[:-1], s[1:], body) for s in after])
        return self

    def predict(self, drive):
        """Transitions (K, Y) of the drive's steps."""
        asked = self.numbers(drive) / self.scale
        distance = np.square(asked[:, None] - self.known).sum(-1)
        return self.followed[distance.argmin(1)].numpy()

    def numbers(self, drive):
        """Columns and commands (K, X) of each step, without the pose."""
        columns = drive.states[:-1, drive.body.pose_size :]
        return np.hstack([columns, drive.actions])
