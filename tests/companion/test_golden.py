"""Golden figures are compared, and rewritten only where a version was raised."""

import json

import pytest

from companion import numerics
from tests.golden import FILE, Golden


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "golden.json"
    figures = {"loss": 0.123456789123, "curve": [[1.0, 2.0], [3.0, 4.0]]}
    Golden(path, write=True).hold("one", "training", figures, rel=1e-8)
    return path


def test_figures_are_held_to_their_tolerance(file):
    Golden(file, write=False).hold(
        "one", "training", {"loss": 0.124, "curve": [[1, 2], [3, 4.01]]}, rel=0.01
    )
    with pytest.raises(
        AssertionError,
        match=r"one: loss is 0.124.*raise NUMERICS\['training'\] .* 'make golden'",
    ):
        Golden(file, write=False).hold(
            "one", "training", {"loss": 0.124, "curve": [[1, 2], [3, 4]]}, rel=0.001
        )


def test_a_figure_of_todays_versions_is_not_written_over(file):
    before = file.read_bytes()
    with pytest.raises(AssertionError, match="one: loss is 0.2"):
        Golden(file, write=True).hold(
            "one", "training", {"loss": 0.2, "curve": [[1, 2], [3, 4]]}, rel=0.001
        )
    assert file.read_bytes() == before


def test_a_raised_version_asks_for_new_figures(file, monkeypatch):
    monkeypatch.setitem(numerics.NUMERICS, "training", 2)
    with pytest.raises(
        AssertionError,
        match="has no 'one' of today's versions; 'make golden' writes it",
    ):
        Golden(file, write=False).hold("one", "training", {"loss": 0.2}, rel=0.001)
    Golden(file, write=True).hold("one", "training", {"loss": 0.2}, rel=0.001)
    assert json.loads(file.read_text())["one"] == {
        "numerics": numerics.versions("training"),
        "figures": {"loss": 0.2},
    }


def test_every_kind_of_work_has_golden_figures():
    kinds = {
        kind
        for record in Golden(FILE, write=False).stored.values()
        for kind in record["numerics"]
    }
    assert kinds == set(numerics.NUMERICS)
