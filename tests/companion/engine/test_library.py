"""Windows whose maps are in a file; drives that another body sees."""

from pathlib import Path

import numpy as np
import pytest
import torch

from companion.bodies import NOVICES, seen_by
from companion.engine.library import windows_with_file
from sidm.body import ROVER
from sidm.config import ConfigError, replace
from sidm.drives import Drive
from sidm.learning import windows_of
from sidm.shards import ShardError


@pytest.fixture
def drives(make_trajectories):
    return make_trajectories(4)


def cached(root):
    return list(root.glob("maps-*.npy"))


def test_windows_are_those_of_the_drives_and_maps_are_computed_once(
    drives, tmp_path, monkeypatch
):
    expected = windows_of(drives, 8)
    for _ in range(2):  # the file is made, then read
        motion = windows_with_file(tmp_path, drives, 8)
        for name in ("inputs", "targets", "maps"):
            assert torch.equal(getattr(motion, name), getattr(expected, name))
        build = "sidm.terrain.generate_terrain"
        monkeypatch.setattr(build, lambda *_: pytest.fail("built a terrain again"))
    (path,) = cached(tmp_path)
    mapped = Path("/proc/self/maps")  # maps stay in their file
    assert not mapped.exists() or path.name in mapped.read_text()
    before = path.read_bytes()
    motion.maps.zero_()
    assert path.read_bytes() == before


def test_each_resolution_count_and_kind_of_map_has_its_file(drives, tmp_path):
    for count, pixels in ((3, 8), (3, 7), (4, 8)):
        motion = windows_with_file(tmp_path, drives[:count], pixels)
        assert motion.maps.shape == (count, 6, pixels, pixels)
    small = windows_with_file(tmp_path, drives, 8, NOVICES["small map"])
    assert small.maps.shape == (4, 6, 16, 16) and len(cached(tmp_path)) == 4
    assert not windows_with_file(tmp_path, drives, 8, NOVICES["no map"]).maps.numel()


@pytest.mark.parametrize("content", [b"", b"not an array", b"\x93NUMPY\x01\x00"])
def test_damaged_maps_are_named(drives, tmp_path, content):
    windows_with_file(tmp_path, drives, 8)
    (path,) = cached(tmp_path)
    path.write_bytes(content)
    with pytest.raises(ShardError, match="maps-8-.*damaged.*delete the file") as error:
        windows_with_file(tmp_path, drives, 8)
    assert "\n" not in str(error.value)
    np.save(path, np.zeros((1, 2), np.float16))
    with pytest.raises(ShardError, match=r"maps \(1, 2\) where \(4, 6, 8, 8\)"):
        windows_with_file(tmp_path, drives, 8)


def test_a_drive_is_seen_by_another_body():
    """The robot stands at 1, 2 with a yaw of 0.5, and rolls forward with 3 m/s."""
    states = np.zeros((2, 13))
    states[:, :2], states[:, 5:7] = (1, 2), (np.sin(0.25), np.cos(0.25))
    states[:, 7] = 3
    drive = Drive(states, np.array([[0.5, 0.2]]))
    seen = {name: seen_by([drive], body)[0] for name, body in NOVICES.items()}
    assert seen["planar"].states[0] == pytest.approx([1, 2, 0.5, 0, 0, 1, 3, *[0] * 5])
    assert seen["left and right"].actions[0] == pytest.approx([0.7, 0.3])
    assert seen["no linear velocity"].states[0] == pytest.approx(
        [*states[0, :7], *states[0, 10:]]
    )
    assert seen_by([drive], ROVER) == [drive]
    body = replace(NOVICES["planar"], columns=(("yaw_rate", "rad/s"),))
    with pytest.raises(ConfigError, match="yaw_rate"):
        seen_by([drive], body)
