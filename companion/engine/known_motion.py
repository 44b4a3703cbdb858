"""Which motion the stored results were made with: `datasets.jsonl` among the results.

Another processor rounds differently, and contact amplifies the difference with every
step: motion that is simulated again elsewhere has other bits, and so another digest.
Beside the digest stands a likeness, which tells such motion from really other motion.
"""

from __future__ import annotations

import functools
from collections.abc import Iterable, Mapping
from pathlib import Path

from companion.engine.datasets import digest_of
from companion.engine.likeness import Likeness
from companion.engine.lines import read_lines, write_lines
from companion.trials import Dataset
from sidm.config import (
    ConfigError,
    DataError,
    config,
    from_mapping,
    replace,
    to_mapping,
)
from sidm.shards import load
from sidm.storage import Damaged, locked

FILE = "datasets.jsonl"


class OtherMotion(DataError):
    """Results of different motion do not belong together; one line says which."""


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
        all_known = read(results) | {one.name: one for one in entries}
        write_lines(path, map(to_mapping, sorted(all_known.values(), key=_name)))


def _name(known: Known) -> str:
    return known.name


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
    if known is not None and digest in known.digests:
        return []
    if known is not None and known.likeness is None:
        return ["the data differ, and the results store no likeness to compare"]
    likeness = Likeness.of(load(Path(data), dataset.collection, dataset.count))
    if known is None:
        note([Known(name=dataset.name, digest=digest, likeness=likeness)], results)
        return []
    assert known.likeness is not None
    if not (differences := known.likeness.differences(likeness)):
        note([replace(known, same=(*known.same, digest))], results)
    return differences


def refuse_other_motion(
    datasets: Iterable[Dataset], data: str | Path, results: str | Path
) -> None:
    """Refuse to add results of other motion to `results`."""
    for dataset in datasets:
        if differences := compare(dataset, data, results):
            raise OtherMotion(
                f"{dataset.name}: the motion under {data} is not that of {results}: "
                f"{'; '.join(differences)}; name another folder of results"
            )


def refuse_mixed(
    seen: Iterable[Mapping[str, str]], results: str | Path = "results"
) -> None:
    """Refuse a table whose rows were made with different motion.

    Raises:
        OtherMotion: names the first dataset that differs by more than rounding.
    """
    known = read(results)
    digests: dict[str, str] = {}
    for row in seen:
        for name, digest in row.items():
            first = digests.setdefault(name, digest)
            if first != digest:
                one = known.get(name)
                if one is None or not {first, digest} <= set(one.digests):
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
            if not _alike(own, theirs):
                raise OtherMotion(
                    f"{other}: {theirs.name} is other motion than that of {results}; "
                    "keep these results apart"
                )
            digests = dict.fromkeys((*own.digests, *theirs.digests))
            new.append(replace(own, same=tuple(digests)[1:]))
    if new:
        note(new, results)


def _alike(one: Known, other: Known) -> bool:
    """Whether two entries are known to be the same motion but for rounding."""
    if set(one.digests) & set(other.digests):
        return True
    if one.likeness is None or other.likeness is None:
        return False
    return not one.likeness.differences(other.likeness)
