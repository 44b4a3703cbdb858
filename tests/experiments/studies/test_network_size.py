"""Networks of several sizes."""

from collections import Counter

import pytest

from sidm.experiments import Study
from sidm.experiments.engine.frame import frame_of
from sidm.experiments.studies.network_size import LARGE, SIZES, table, trials


@pytest.fixture
def every(tmp_path):
    return trials(Study("study", tmp_path, tmp_path), "system1")


def test_each_size_is_trained_once(every):
    """The largest by the paper's two methods alone."""
    counts = Counter((t.network.pixels, t.network.layers, t.network.hidden) for t in every)
    assert counts == {size: seeds * (2 if size in LARGE else 3) for size, seeds in SIZES.items()}
    assert {t.novice_minutes for t in every} == {5.0} and len({t.key for t in every}) == len(every)


def test_methods_stand_beside_training_without_sidm_of_the_same_size(every, make_row):
    """Made up: an SIDM saves more the larger the map."""
    found = table(frame_of(
        make_row(t, 1.0 if t.method == "novice_only" else 16 / t.network.pixels) for t in every
    )).set_index(["method", "pixels", "layers"])  # fmt: skip
    assert [found.ratio["sidm", pixels, 3] for pixels in (16, 32, 64)] == pytest.approx([1, 0.5, 0.25])
    assert len(found) == 2 * 3 + 2
