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

from companion.engine.datasets import digest_of
from companion.engine.known_motion import Known, Likeness, compare, note, read
from companion.trials import Dataset
from sidm.config import replace
from sidm.shards import SHARD_SIZE, Collection
from sidm.simulation import collect
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
    collect(data, DATASET.collection, DATASET.count, progress=False)
    assert compare(DATASET, data, results) == []  # which notes it
    return results


@pytest.mark.more
def test_what_differs_by_rounding_alone_stands_for_the_results_motion(
    results, tmp_path
):
    """Data of a processor with fewer instructions; without a likeness nobody knows."""
    data = tmp_path / "reduced"
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
    known, digest = read(results)[DATASET.name].digest, digest_of(DATASET, data)
    reduced = bool(REDUCED["NPY_DISABLE_CPU_FEATURES"])
    assert (digest != known) == reduced, "rounded alike"
    assert compare(DATASET, data, results) == []
    assert set(read(results)[DATASET.name].digests) == {known, digest}
    note([Known(name=DATASET.name, digest="0123456789abcdef")], tmp_path)
    assert compare(DATASET, data, tmp_path) == [
        "the data differ, and the results store no likeness to compare"
    ]


@pytest.mark.more
def test_another_robots_motion_is_refused(results, tmp_path, monkeypatch):
    """Tyres have a tenth less friction."""
    from sidm.simulation.collecting import make_shard

    own = SYSTEMS["system1"]
    slippery = dataclasses.replace(own.novice, friction=0.9 * own.novice.friction)
    monkeypatch.setitem(SYSTEMS, "system1", dataclasses.replace(own, novice=slippery))
    for number in range(DATASET.count // SHARD_SIZE):
        make_shard(tmp_path, DATASET.collection, number)
    before = read(results)
    words = compare(DATASET, tmp_path, results)[0]
    assert words.startswith("after 5 steps robots are ")
    assert read(results) == before


def test_other_actions_and_other_attempts_are_seen(make_trajectories):
    one = make_trajectories(40)
    like = Likeness.of(one)
    assert like.differences(Likeness.of(one)) == []
    other = [replace(t, actions=t.actions + 0.3) for t in one]
    assert "standard errors apart" in like.differences(Likeness.of(other))[0]
    seeds = [t.ground.seed + 100 * (t.index % 2 == 0) for t in one]
    others = [
        replace(t, ground=t.ground._replace(seed=seed))
        for t, seed in zip(one, seeds, strict=True)
    ]
    assert "are other attempts" in like.differences(Likeness.of(others))[0]
    fewer = Likeness.of(one[:8])
    assert like.differences(fewer) == ["another number of trajectories"]
