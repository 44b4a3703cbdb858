"""Motion simulated again on another processor stands for the motion of the results.

It may differ by rounding; other motion is refused.
"""

import dataclasses
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from companion.digests import find_digest
from companion.engine.datasets import load_dataset, note_committed, note_digest, verify
from companion.engine.likeness import Likeness
from companion.trials import Dataset
from sidm.config import replace
from sidm.shards import SHARD_SIZE, Collection, load
from sidm.simulation import collect
from sidm.storage import read_record
from sidm.systems import SYSTEMS

DATASET = Dataset(
    collection=Collection(system="system1", role="novice", seed=78), count=8
)
#: variables that select the oldest x86 instructions of NumPy and OpenBLAS; on other
#: processors they change nothing, and the bits may be the same
REDUCED = {
    "OPENBLAS_CORETYPE": "Nehalem",
    "NPY_DISABLE_CPU_FEATURES": " ".join(
        name
        for name, there in np._core._multiarray_umath.__cpu_features__.items()
        if there and name in np._core._multiarray_umath.__cpu_dispatch__
    ),
}


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """Results of another machine, whose data are not on this one."""
    data, results = tmp_path_factory.mktemp("data"), tmp_path_factory.mktemp("results")
    digest = note_digest(
        DATASET,
        collect(data, DATASET.collection, DATASET.count, workers=2, progress=False),
        data,
    )
    note_committed(DATASET, digest, data, results)
    return results


@pytest.fixture(scope="module")
def reduced(tmp_path_factory):
    """Data of a processor with fewer instructions."""
    data = tmp_path_factory.mktemp("reduced")
    code = f"""if True:
        from pathlib import Path
        from sidm.simulation.collecting import make_shard
        from sidm.shards import Collection
        for number in range({DATASET.count // SHARD_SIZE}):
            make_shard(Path({str(data)!r}), {DATASET.collection!r}, number)
    """
    root = Path(__file__).parents[3]
    subprocess.run(
        [sys.executable, "-c", code], env=os.environ | REDUCED, check=True, cwd=root
    )
    return data


@pytest.mark.more
def test_what_differs_by_rounding_alone_serves_under_the_same_digest(results, reduced):
    known = read_record(next(results.rglob("*.json")))["digest"]
    digest = note_digest(
        DATASET, load(reduced, DATASET.collection, DATASET.count), reduced
    )
    assert (digest != known) == bool(REDUCED["NPY_DISABLE_CPU_FEATURES"]), (
        "rounded alike"
    )
    assert find_digest(DATASET, reduced, results) == digest, (
        "not held against the results' yet"
    )
    assert verify(DATASET, reduced, results) == []
    assert find_digest(DATASET, reduced, results) == known
    assert len(load_dataset(DATASET, known, reduced)) == DATASET.count


@pytest.mark.more
def test_another_robots_motion_is_refused(results, tmp_path, monkeypatch):
    """Tyres have a tenth less friction; the digest stays that of the new data."""
    from sidm.simulation.collecting import make_shard

    own = SYSTEMS["system1"]
    slippery = dataclasses.replace(own.novice, friction=0.9 * own.novice.friction)
    monkeypatch.setitem(SYSTEMS, "system1", dataclasses.replace(own, novice=slippery))
    for number in range(DATASET.count // SHARD_SIZE):
        make_shard(tmp_path, DATASET.collection, number)
    (words,) = verify(DATASET, tmp_path, results)[:1]
    assert words.startswith("after 5 steps robots are ")
    assert find_digest(DATASET, tmp_path, results) == note_digest(
        DATASET, load(tmp_path, DATASET.collection, DATASET.count), tmp_path
    )


def test_other_actions_and_other_attempts_are_seen(make_trajectories):
    one = make_trajectories(40)
    other = [replace(t, actions=t.actions + 0.3) for t in one]
    assert Likeness.of(one).differences(Likeness.of(one)) == []
    assert (
        "standard errors apart" in Likeness.of(one).differences(Likeness.of(other))[0]
    )
    seeds = [t.ground.seed + 100 * (t.index % 2 == 0) for t in one]
    others = [
        replace(t, ground=t.ground._replace(seed=seed))
        for t, seed in zip(one, seeds, strict=True)
    ]
    assert "are other attempts" in Likeness.of(one).differences(Likeness.of(others))[0]
    assert Likeness.of(one).differences(Likeness.of(one[:8])) == [
        "another number of trajectories"
    ]


@pytest.mark.more
def test_what_the_results_do_not_know_is_said(results, reduced, tmp_path):
    assert verify(DATASET, reduced, tmp_path) == ["the results know no such data"]
    note_committed(DATASET, "0123456789abcdef", tmp_path, tmp_path)
    assert verify(DATASET, reduced, tmp_path) == [
        "the data differ, and the results store no likeness to compare"
    ]
