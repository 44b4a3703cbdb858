"""Files are written whole or not at all; damage and hostile files are refused."""

import errno
import io
import os
import pickle
import time
from hashlib import sha256

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sidm import storage
from sidm.storage import Damaged, read_arrays, read_record, write_record

ARRAYS = {"numbers": np.arange(6.0).reshape(2, 3), "one": np.array(3)}
VALUES = {"a": 0.1 + 0.2, "b": [1, None, 'x"\n'], "c": {"checksum": "none"}}


class Trap:
    """Object whose unpickling would make a file."""

    def __init__(self, path):
        self.path = str(path)

    def __reduce__(self):
        return open, (self.path, "w")


def test_arrays_come_back_also_to_others(tmp_path):
    path = tmp_path / "new" / "a.npz"
    storage.write_arrays(path, ARRAYS)
    with np.load(path, allow_pickle=False) as data:
        for found in (read_arrays(path), data):
            assert all(np.array_equal(found[name], ARRAYS[name]) for name in ARRAYS)
    assert os.listdir(path.parent) == ["a.npz"]


def test_records_come_back_a_line_a_value(tmp_path):
    path = tmp_path / "a.json"
    write_record(path, VALUES)
    assert len(path.read_text().splitlines()) == 6
    with pytest.raises(ValueError, match="not JSON compliant"):
        write_record(path, {"a": float("nan")})
    assert read_record(path) == VALUES and os.listdir(tmp_path) == ["a.json"]


@given(
    where=st.floats(0, 1, exclude_max=True), bit=st.integers(0, 7), cut=st.booleans()
)
@pytest.mark.parametrize(
    ("write", "read", "content"),
    [(storage.write_arrays, read_arrays, ARRAYS), (write_record, read_record, VALUES)],
)
def test_a_flipped_bit_or_a_lost_end_is_seen(
    tmp_path, write, read, content, where, bit, cut
):
    path = tmp_path / "a"
    write(path, content)
    found = bytearray(path.read_bytes())
    place = int(where * len(found))
    found[place] ^= 1 << bit
    path.write_bytes(found[:place] if cut else found)
    with pytest.raises(Damaged) as caught:
        read(path)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("read", [read_arrays, read_record])
def test_a_folder_or_nothing_is_no_file(tmp_path, read):
    with pytest.raises(FileNotFoundError):
        read(tmp_path / "none")
    with pytest.raises(Damaged, match="directory"):
        read(tmp_path)


@pytest.mark.parametrize("failing", ["write", "fsync", "replace"])
def test_a_full_disk_is_one_line_and_leaves_what_was(tmp_path, monkeypatch, failing):
    path = tmp_path / "a.json"
    write_record(path, {"x": 1})

    def full(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    write = full if failing == "write" else lambda file: file.write(b"half")
    if failing != "write":
        monkeypatch.setattr(os, failing, full)
    with pytest.raises(OSError, match=r"a\.json: cannot be written \(No space .*\)$"):
        storage.write_atomically(path, write)
    assert read_record(path) == {"x": 1} and os.listdir(tmp_path) == ["a.json"]


def test_a_link_is_replaced_and_its_target_stays(tmp_path):
    outside, path = tmp_path / "outside", tmp_path / "a.json"
    outside.write_text("mine")
    path.symlink_to(outside)
    write_record(path, {"x": 1})
    assert outside.read_text() == "mine"
    assert not path.is_symlink() and read_record(path) == {"x": 1}


def test_a_pickle_disguised_as_arrays_is_not_opened(tmp_path):
    trap, archive = tmp_path / "sprung", io.BytesIO()
    np.savez(archive, x=np.array([Trap(trap)], object))
    body = archive.getvalue()[:-2] + (64).to_bytes(2, "little")
    sealed = body + sha256(body).hexdigest().encode()  # as this package's archives
    for content in (pickle.dumps(Trap(trap)), archive.getvalue(), sealed):
        (tmp_path / "a.npz").write_bytes(content)
        with pytest.raises(Damaged):
            read_arrays(tmp_path / "a.npz")
    assert not trap.exists()


def test_what_killed_writers_left_is_swept(tmp_path):
    hour_ago = time.time() - 4000
    for name in (".a.npz.x1.part", ".b.npz.x2.part", "c.part"):
        (tmp_path / name).write_text("half")
        if name != ".b.npz.x2.part":
            os.utime(tmp_path / name, (hour_ago, hour_ago))
    storage.sweep(tmp_path)
    assert sorted(os.listdir(tmp_path)) == [".b.npz.x2.part", "c.part"]


def test_a_pipe_stays_a_pipe(tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    storage.write_atomically(pipe, lambda stream: stream.write(b"through"))
    assert os.read(reader, 100) == b"through" and pipe.is_fifo()
    os.close(reader)
