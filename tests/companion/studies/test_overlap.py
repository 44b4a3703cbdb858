"""What the expert's motion covers of the novice's, on made-up steps."""

import numpy as np
import pytest

from companion.engine.datasets import load_dataset
from companion.studies.overlap import (
    Neighbourhood,
    measure,
    neighbourhoods,
    read,
    steps,
)
from companion.study import Study


@pytest.fixture
def drawn():
    """Inputs (N, 11) about a place and the linear transitions (N, 13) that follow:
    drawn(count, place, answer)."""
    rng = np.random.default_rng(0)
    law = rng.normal(size=(11, 13))

    def draw(count, place=0.0, answer=0.0):
        inputs = place + rng.normal(size=(count, 11))
        return inputs, inputs @ law + answer

    return draw


def test_like_robots_cover_each_other(drawn):
    both = neighbourhoods(drawn(2000), drawn(2000), drawn(1000))
    assert (
        both["expert"].uncovered == pytest.approx(0.05, abs=0.03)
        and both["novice"].uncovered == 0.05
    )
    assert both["expert"].distance == pytest.approx(both["novice"].distance, rel=0.05)
    assert both["expert"].loss == pytest.approx(both["novice"].loss, rel=0.1)


def test_an_expert_that_was_elsewhere_covers_nothing(drawn):
    both = neighbourhoods(drawn(500, place=9.0), drawn(500), drawn(300))
    assert (
        both["expert"].uncovered == 1
        and both["expert"].distance > 4 * both["novice"].distance
    )


def test_another_answer_costs_its_square(drawn):
    """Each of the 13 components off by 2 adds 52, wherever the neighbours are the
    same."""
    inputs, targets = drawn(800)
    same = inputs, targets + 2
    both = neighbourhoods(same, (inputs, targets), (inputs[:200], targets[:200]))
    errors = both["expert"].loss - both["novice"].loss
    assert both["expert"].uncovered == both[
        "novice"
    ].uncovered and errors == pytest.approx(52, abs=8)


def test_what_is_measured_is_read(tiny, data, tmp_path, monkeypatch):
    """Of both systems; one and the same motion stands in for the second."""
    monkeypatch.setattr("companion.studies.overlap.SYSTEMS", ("system1",))
    study = Study(tiny, data, tmp_path)
    assert read(tmp_path) == {}
    measure(study, tmp_path)
    found = read(tmp_path)["system1"]
    monkeypatch.setattr("companion.studies.overlap.SYSTEMS", ("system1", "added"))
    assert list(read(tmp_path)) == ["system1"]
    assert set(found) == {"expert", "novice"} and all(
        isinstance(one, Neighbourhood) for one in found.values()
    )
    validation = load_dataset(
        tiny.datasets("system1")["validation"],
        study.digests("system1")["validation_data"],
        data,
    )
    inputs, targets = steps(validation, 10**6)
    assert inputs.shape == (64 * len(validation), 11) and targets.shape == (
        64 * len(validation),
        13,
    )
