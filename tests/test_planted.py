"""Each planted change has a place in today's code, and a golden test to see it."""

import shutil

import pytest

from tests.planted import CHANGES, ROOT, plant


@pytest.mark.parametrize("change", CHANGES, ids=lambda change: change.file)
def test_a_planted_change_has_its_place(tmp_path, change):
    target = tmp_path / change.file
    target.parent.mkdir(parents=True)
    shutil.copy(ROOT / change.file, target)
    plant(change, tmp_path)
    compile(target.read_text(), change.file, "exec")
    assert (ROOT / change.tests).is_file()
