"""The part of the novice's motion that the expert's covers, on made-up steps."""

import numpy as np
import pytest

from companion.studies.overlap import (
    Neighbourhood,
    measure,
    neighbourhoods,
    read,
    steps,
)
from companion.study import Study
from sidm.shards import load


@pytest.fixture
def drawn():
    """Inputs (N, 11) about a place and their linear transitions (N, 13).

    Call `drawn(count, place, answer)`.
    """
    rng = np.random.default_rng(0)
    law = rng.normal(size=(11, 13))

    def draw(count, place=0.0, answer=0.0):
        inputs = place + rng.normal(size=(count, 11))
        return inputs, inputs @ law + answer

    return draw


def test_like_robots_cover_each_other(drawn):
    both = neighbourhoods(drawn(2000), drawn(2000), drawn(1000))
    assert both["expert"].uncovered == pytest.approx(0.05, abs=0.03)
    assert both["novice"].uncovered == 0.05
    assert both["expert"].distance == pytest.approx(both["novice"].distance, rel=0.05)
    assert both["expert"].loss == pytest.approx(both["novice"].loss, rel=0.1)


def test_an_expert_that_was_elsewhere_covers_nothing(drawn):
    both = neighbourhoods(drawn(500, place=9.0), drawn(500), drawn(300))
    assert both["expert"].uncovered == 1
    assert both["expert"].distance > 4 * both["novice"].distance


def test_another_answer_costs_its_square(drawn):
    """Each of the 13 components is off by 2, which adds 52.

    This holds wherever the neighbours are the same.
    """
    inputs, targets = drawn(800)
    same = inputs, targets + 2
    both = neighbourhoods(same, (inputs, targets), (inputs[:200], targets[:200]))
    errors = both["expert"].loss - both["novice"].loss
    assert both["expert"].uncovered == both["novice"].uncovered
    assert errors == pytest.approx(52, abs=8)


def test_what_is_measured_is_read(tiny, data, tmp_path, monkeypatch):
    """Both systems are read; the same motion stands in for the second."""
    monkeypatch.setattr("companion.studies.overlap.PAPER_SYSTEMS", ("system1",))
    study = Study(tiny, data, tmp_path)
    assert read(tmp_path) == {}
    measure(study, tmp_path)
    stored = read(tmp_path)["system1"]
    monkeypatch.setattr("companion.studies.overlap.PAPER_SYSTEMS", ("system1", "added"))
    assert list(read(tmp_path)) == ["system1"]
    assert set(stored) == {"expert", "novice"}
    assert all(isinstance(record, Neighbourhood) for record in stored.values())
    dataset = tiny.datasets("system1")["validation"]
    validation = load(data, dataset.collection, dataset.count)
    inputs, targets = steps(validation, 10**6)
    assert inputs.shape == (64 * len(validation), 11)
    assert targets.shape == (64 * len(validation), 13)
