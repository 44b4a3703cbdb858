"""Which motion the stored results were made with: `datasets.jsonl` among the results.

Processors round differently, and contact amplifies the difference with every step:
after half a second of driving the robots are micrometres apart, after six seconds
centimetres. So motion that is simulated again elsewhere has other bits, and another
digest. The positions after few steps and the moments of all steps stay; this likeness,
which is stored beside the digest, tells such motion from really other motion.
"""

from __future__ import annotations

import functools
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np

from companion.engine.datasets import PART, digest_of, is_here
from companion.engine.lines import read_lines, write_lines
from companion.trials import Dataset, Trial, motion_of
from sidm.config import (
    ConfigError,
    DataError,
    config,
    from_mapping,
    replace,
    to_mapping,
)
from sidm.drives import POSITION, Drive
from sidm.shards import load, simulated_ground
from sidm.storage import Damaged, locked

FILE = "datasets.jsonl"
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


class OtherMotion(DataError):
    """Results of different motion do not belong together; one line says which."""


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


@config
class Known:
    """A dataset that results were made with.

    Attributes:
        name: of the dataset, as `Dataset.name`
        digest: of its motion
        likeness: of its motion; None where it was never measured
        same: digests of motion that was simulated again and differs by rounding alone
    """

    name: str
    digest: str
    likeness: Likeness | None = None
    same: tuple[str, ...] = ()

    @property
    def digests(self) -> tuple[str, ...]:
        """All digests that stand for this dataset."""
        return self.digest, *self.same

    def differences(self, digest: str, likeness: Likeness | None) -> list[str]:
        """How other motion differs by more than rounding, in words."""
        if digest in self.digests:
            return []
        if self.likeness is None or likeness is None:
            return ["the data differ, and the results store no likeness to compare"]
        return self.likeness.differences(likeness)


def read(results: str | Path = "results") -> dict[str, Known]:
    """The datasets that results were made with, by name; none where none are stored."""
    path = Path(results) / FILE
    if not path.exists():
        return {}
    status = path.stat()
    return _read(path, status.st_mtime_ns, status.st_size)


@functools.lru_cache(maxsize=8)
def _read(path: Path, *_: int) -> dict[str, Known]:
    try:
        known = [from_mapping(Known, values) for values in read_lines(path)]
    except (Damaged, ConfigError, TypeError) as error:
        raise ConfigError(f"{path}: damaged ({error}); restore it") from None
    return {one.name: one for one in known}


def note(entries: Iterable[Known], results: str | Path = "results") -> None:
    """Write datasets, each in place of an entry of the same name."""
    path = Path(results) / FILE
    with locked(path):
        known = read(results) | {one.name: one for one in entries}
        write_lines(path, [to_mapping(known[name]) for name in sorted(known)])


def compare(
    dataset: Dataset, data: str | Path = "data", results: str | Path = "results"
) -> list[str]:
    """How a whole dataset under `data` differs, by more than rounding, from `results`'.

    A dataset that the results do not know is noted there; so is the digest of one that
    differs by rounding alone.

    Returns:
        The differences in words, one entry each.
    """
    known, digest = read(results).get(dataset.name), digest_of(dataset, data)
    if known is not None and (digest in known.digests or known.likeness is None):
        return known.differences(digest, None)
    likeness = Likeness.of(load(Path(data), dataset.collection, dataset.count))
    if known is None:
        note([Known(name=dataset.name, digest=digest, likeness=likeness)], results)
        return []
    differences = known.differences(digest, likeness)
    if not differences:
        note([replace(known, same=(*known.same, digest))], results)
    return differences


def refuse_motion(
    trials: Iterable[Trial], data: str | Path, results: str | Path
) -> None:
    """Refuse trials whose motion is not under `data`, or is not that of `results`."""
    needed = motion_of(trials)
    for dataset, which in needed.items():
        if not is_here(dataset, data, which):
            raise ConfigError(
                f"the dataset {dataset.name} is not under {data}; 'companion collect "
                "--preset NAME --figure NAME' makes what trials need"
            )
    for dataset, which in needed.items():
        whole = len(which) == dataset.count
        if whole and (differences := compare(dataset, data, results)):
            raise OtherMotion(
                f"{dataset.name}: the motion under {data} is not that of {results}: "
                f"{'; '.join(differences)}; name another folder of results"
            )


def refuse_mixed(
    seen: Iterable[Mapping[str, str]], results: str | Path = "results"
) -> None:
    """Refuse a table whose rows saw datasets, name -> digest, of different motion.

    What trials draw of a novice's pool is not compared: its digest is of the drawn part
    alone, and `refuse_motion` has compared the validation motion of the same robot.
    """
    known, digests = read(results), dict[str, str]()
    for name, digest in (item for row in seen for item in row.items()):
        if PART in name:
            continue
        first = digests.setdefault(name, digest)
        same = known[name].digests if name in known else ()
        if first != digest and not {first, digest} <= {*same}:
            raise OtherMotion(
                f"{results}: rows of {name} were made with different motion, "
                f"{first} and {digest}; 'companion collect --verify' tells "
                "whether it differs by rounding alone"
            )


def again_elsewhere(seen: Mapping[str, str], known: Mapping[str, Known]) -> bool:
    """Whether a row was made with motion that was simulated again, and rounded."""
    return any(n in known and digest in known[n].same for n, digest in seen.items())


def take_in(other: str | Path, results: str | Path = "results") -> None:
    """Note the datasets that other results were made with."""
    mine, new = read(results), []
    for theirs in read(other).values():
        own = mine.get(theirs.name)
        if own is None:
            new.append(theirs)
        elif set(theirs.digests) - set(own.digests):
            shared = set(own.digests) & set(theirs.digests)
            if not shared and own.differences(theirs.digest, theirs.likeness):
                raise OtherMotion(
                    f"{other}: {theirs.name} is other motion than that of {results}; "
                    "keep these results apart"
                )
            digests = dict.fromkeys((*own.digests, *theirs.digests))
            new.append(replace(own, same=tuple(digests)[1:]))
    if new:
        note(new, results)
