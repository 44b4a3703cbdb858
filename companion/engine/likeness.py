"""Whether motion that was simulated again on another machine is the same but for rounding.

Processors round otherwise, and contact makes more of it with every step: in half a
second of driving a robot is micrometres from where it was, in six seconds centimetres.
So a digest of bits tells two machines' data apart. What tells them from other data is
where robots are after few steps, and the moments of all steps: they are kept with a
dataset's digest.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sidm.config import config
from sidm.drives import POSITION, Drive
from sidm.shards import simulated_ground

SAMPLED = 32  # trajectories, evenly spread
EARLY = 5  # control steps after which their places are held against each other
#: m, the median distance of places: 48 trajectories each of three robots on smaller
#: instruction sets: up to 0.00003.
NEAR = 0.0003
#: least share of the sampled; the others had an attempt thrown away that the first
#: machine kept
SAME_ATTEMPTS = 0.9
STANDARD_ERRORS = 3.0  # most between moments; of the same 144 trajectories: up to 0.8


@config
class Likeness:
    """What motion is known again by: S sampled trajectories; moments of K = 15 numbers, transition and action."""

    terrain_seeds: tuple[int, ...]  # (S,) each attempt at a trajectory has its own
    places: tuple[tuple[float, ...], ...]  # (S, 3) m, after EARLY steps
    #: (2 K,) mean and mean square over all steps of all trajectories
    moments: tuple[float, ...]
    standard_errors: tuple[float, ...]  # (2 K,) of them, over trajectories

    @classmethod
    def of(cls, trajectories: Sequence[Drive]) -> Likeness:
        """That of a dataset of at least one trajectory."""
        import torch  # which takes seconds, and reading results does not need it

        from sidm.learning.observation import transition

        chosen = np.unique(
            np.linspace(0, len(trajectories) - 1, SAMPLED).round().astype(int)
        )
        sampled = [trajectories[number] for number in chosen]
        # (N, T + 1, 13)
        states = torch.from_numpy(np.stack([t.states for t in trajectories])).double()
        actions = np.stack([t.actions for t in trajectories]).astype(float)  # (N, T, 2)
        # (N, T, K)
        numbers = np.concatenate(
            [transition(states[:, :-1], states[:, 1:]).numpy(), actions], axis=-1
        )
        # (N, 2 K)
        means = np.concatenate([numbers.mean(1), (numbers**2).mean(1)], axis=-1)
        return cls(
            terrain_seeds=tuple(simulated_ground(t).seed for t in sampled),
            places=tuple(tuple(_short(t.states[EARLY, POSITION])) for t in sampled),
            moments=tuple(_short(means.mean(0))),
            standard_errors=tuple(_short(means.std(0) / np.sqrt(len(means)))),
        )

    def differences(self, other: Likeness) -> list[str]:
        """How `other` is not the same motion but for rounding, in words; empty where it is."""
        if len(other.terrain_seeds) != len(self.terrain_seeds):
            return ["another number of trajectories"]
        same = np.equal(self.terrain_seeds, other.terrain_seeds)
        if same.mean() < SAME_ATTEMPTS:
            return [
                f"{(~same).sum()} of {len(same)} sampled trajectories are other attempts"
            ]
        words = []
        apart = np.linalg.norm(np.subtract(self.places, other.places), axis=1)[same]
        if np.median(apart) > NEAR:
            words.append(
                f"after {EARLY} steps robots are {np.median(apart):.2g} m apart, more than {NEAR:g} m"
            )
        errors = np.maximum(self.standard_errors, 1e-9)
        far = np.max(np.abs(np.subtract(self.moments, other.moments)) / errors)
        if far > STANDARD_ERRORS:
            words.append(
                f"moments of the motion are {far:.2g} standard errors apart, more than {STANDARD_ERRORS:g}"
            )
        return words


def _short(values: np.ndarray) -> list[float]:
    """With 7 significant digits, for a file."""
    return [float(f"{value:.7g}") for value in values.tolist()]
