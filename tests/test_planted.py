"""A planted change of the numbers has its place in the code, and a test sees it."""

import shutil

import pytest

from tests.planted import CHANGES, ROOT, is_seen, plant


@pytest.mark.parametrize("change", CHANGES, ids=lambda change: change.file)
def test_a_planted_change_has_its_place(tmp_path, change):
    target = tmp_path / change.file
    target.parent.mkdir(parents=True)
    shutil.copy(ROOT / change.file, target)
    plant(change, tmp_path)
    compile(target.read_text(), change.file, "exec")
    assert (ROOT / change.tests).is_file()


@pytest.mark.more
@pytest.mark.parametrize("change", CHANGES, ids=lambda change: change.file)
def test_a_planted_change_is_seen(tmp_path, change):
    assert is_seen(change, tmp_path)
