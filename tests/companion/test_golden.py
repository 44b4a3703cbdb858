"""Golden figures are compared, and rewritten only where a version was raised."""

import json

import pytest

from companion import numerics
from tests.golden import FILE, Golden

CURVE = [[1.0, 2.0], [3.0, 4.0]]


def test_figures_are_held_and_written_over_where_a_version_was_raised(
    tmp_path, monkeypatch
):
    path = tmp_path / "golden.json"

    def hold(loss, rel=0.001, write=False):
        figures = {"loss": loss, "curve": CURVE}
        Golden(path, write=write).hold("one", "training", figures, rel=rel)
        return json.loads(path.read_text())["one"]

    hold(0.123, write=True)
    hold(0.124, rel=0.01)
    words = r"one: loss is 0.2.*raise RESULT_VERSIONS\['training'\] .* 'make golden'"
    for write in (False, True):
        with pytest.raises(AssertionError, match=words):
            hold(0.2, write=write)
    assert hold(0.123)["figures"]["loss"] == 0.123
    monkeypatch.setitem(numerics.RESULT_VERSIONS, "training", 2)
    with pytest.raises(AssertionError, match="'make golden' writes it"):
        hold(0.2)
    assert hold(0.2, write=True) == {
        "numerics": numerics.versions("training"),
        "figures": {"loss": 0.2, "curve": CURVE},
    }


def test_every_kind_of_work_has_golden_figures():
    stored = Golden(FILE, write=False).stored.values()
    kinds = {kind for record in stored for kind in record["numerics"]}
    assert kinds == set(numerics.RESULT_VERSIONS)
