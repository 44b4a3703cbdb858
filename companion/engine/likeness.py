"""Tell motion that another machine simulated again from other motion.

Processors round differently, and contact amplifies the difference with every step:
after half a second of driving the robots are micrometres apart, after six seconds
centimetres. So the digests of two machines differ. The positions after few steps and
the moments of all steps do not; they are stored with a dataset's digest.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sidm.config import config
from sidm.drives import POSITION, Drive
from sidm.shards import simulated_ground

SAMPLED = 32  # trajectories that are compared, evenly spread
EARLY = 5  # control steps after which positions are compared
#: m, largest median distance of the positions. Between instruction sets, 48
#: trajectories of each of three robots had a median of at most 0.00003 m.
NEAR = 0.0003
#: Least share of sampled trajectories with the same terrain: between two processors it
#: was 0.75 where robots hold their action and often get stuck. For the other
#: trajectories, one machine discarded an attempt that the other machine kept.
SAME_ATTEMPTS = 0.6
#: Largest difference of moments, in standard errors; 0.8 in the comparison above.
STANDARD_ERRORS = 3.0


@config
class Likeness:
    """What is compared: S sampled trajectories, and moments of all trajectories.

    The moments are those of K = 15 numbers: the state transition and the action.
    """

    terrain_seeds: tuple[int, ...]  # (S,) of each trajectory's attempt
    places: tuple[tuple[float, ...], ...]  # (S, 3) m, after EARLY steps
    #: (2 K,) mean and mean square over all steps of all trajectories
    moments: tuple[float, ...]
    standard_errors: tuple[float, ...]  # (2 K,) of the moments, over trajectories

    @classmethod
    def of(cls, trajectories: Sequence[Drive]) -> Likeness:
        """Measure a dataset of at least one trajectory."""
        import torch  # which takes seconds, and reading results does not need it

        from sidm.learning.observation import transition

        even = np.linspace(0, len(trajectories) - 1, SAMPLED)
        sampled = [trajectories[n] for n in np.unique(even.round().astype(int))]
        # (N, T + 1, 13)
        states = torch.from_numpy(np.stack([t.states for t in trajectories])).double()
        actions = np.stack([t.actions for t in trajectories]).astype(float)  # (N, T, 2)
        transitions = transition(states[:, :-1], states[:, 1:]).numpy()
        numbers = np.concatenate([transitions, actions], axis=-1)  # (N, T, K)
        # (N, 2 K)
        means = np.concatenate([numbers.mean(1), (numbers**2).mean(1)], axis=-1)
        return cls(
            terrain_seeds=tuple(simulated_ground(t).seed for t in sampled),
            places=tuple(tuple(_short(t.states[EARLY, POSITION])) for t in sampled),
            moments=tuple(_short(means.mean(0))),
            standard_errors=tuple(_short(means.std(0) / np.sqrt(len(means)))),
        )

    def differences(self, other: Likeness) -> list[str]:
        """How `other` differs by more than rounding, in words; empty if it does not."""
        if len(other.terrain_seeds) != len(self.terrain_seeds):
            return ["another number of trajectories"]
        same = np.equal(self.terrain_seeds, other.terrain_seeds)
        if same.mean() < SAME_ATTEMPTS:
            count = f"{(~same).sum()} of {len(same)}"
            return [f"{count} sampled trajectories are other attempts"]
        differences = []
        apart = np.linalg.norm(np.subtract(self.places, other.places), axis=1)[same]
        if np.median(apart) > NEAR:
            differences.append(
                f"after {EARLY} steps robots are {np.median(apart):.2g} m apart, "
                f"more than {NEAR:g} m"
            )
        errors = np.maximum(self.standard_errors, 1e-9)
        far = np.max(np.abs(np.subtract(self.moments, other.moments)) / errors)
        if far > STANDARD_ERRORS:
            differences.append(
                f"moments of the motion are {far:.2g} standard errors apart, "
                f"more than {STANDARD_ERRORS:g}"
            )
        return differences


def _short(values: np.ndarray) -> list[float]:
    """Values rounded to 7 significant digits, for a file."""
    return [float(f"{value:.7g}") for value in values.tolist()]
