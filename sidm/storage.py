"""Files that exist whole or not at all, and whose checksum shows a changed byte.

Arrays are in an .npz archive whose comment is the SHA-256 of everything before it; any
reader of .npz reads them. Records are JSON whose last value is such a checksum of the
text before it. Nothing is pickled.
"""

from __future__ import annotations

import contextlib
import hashlib
import io
import json
import os
import time
import uuid
import zipfile
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import IO, Any

import numpy as np

from sidm.config import first_line

try:
    import fcntl
except ImportError:  # Windows: two processes may both make the same file
    fcntl = None  # type: ignore[assignment]

SHA256_DIGITS = 64  # hexadecimal
CHECKSUM_KEY = ',\n"checksum": "'  # the text of a record between values and checksum


class Damaged(ValueError):
    """A file is not as it was written; the message is one line without its name."""


def write_atomically(path: Path, write: Callable[[IO[bytes]], object]) -> None:
    """Write a file so that it appears under its name only when it is whole.

    `write` is called with a new, open file beside `path`, which then moves there.

    Raises:
        OSError: the file cannot be written, as on a full disk; one line that names
            `path`. A file that was there before stays.
    """
    if path.exists() and not (path.is_file() or path.is_dir()):
        with open(path, "wb") as stream:  # a device or a pipe is not replaced
            write(stream)
        return
    part = None
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        part = path.parent / f".{path.name}.{uuid.uuid4().hex}.part"
        with open(part, "xb") as file:
            write(file)
            file.flush()
            os.fsync(file.fileno())
        os.replace(part, path)
        _sync_folder(path.parent)
    except OSError as error:
        reason = error.strerror or error
        raise OSError(f"{path}: cannot be written ({reason})") from error
    finally:
        if part is not None:
            with contextlib.suppress(OSError):  # nothing is left, or the disk is gone
                os.unlink(part)


def _sync_folder(folder: Path) -> None:
    """Force the names of a folder's files to disk."""
    try:
        descriptor = os.open(folder, os.O_RDONLY)
    except PermissionError:  # Windows opens no folder; the file itself is written
        return
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


@contextlib.contextmanager
def locked(path: Path) -> Iterator[None]:
    """Let one process of this machine at a time into a block that makes `path`."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with open(path.parent / f".{path.name}.lock", "wb") as lock:
        if fcntl is not None:
            with contextlib.suppress(OSError):  # a file system without locks
                fcntl.flock(lock, fcntl.LOCK_EX)
        yield


def checksum(array: np.ndarray) -> str:
    """A checksum of an array's bytes, shape and type: 16 hexadecimal digits."""
    digest = hashlib.sha256(f"{array.dtype.str}{array.shape}".encode())
    digest.update(np.ascontiguousarray(array).data)
    return digest.hexdigest()[:16]


def sweep(folder: Path, age: float = 3600.0) -> None:
    """Delete files that killed writers left, not written to for `age` seconds."""
    for part in folder.glob(".*.part"):
        with contextlib.suppress(OSError):
            if time.time() - part.stat().st_mtime > age:
                part.unlink()


def write_arrays(path: Path, arrays: Mapping[str, np.ndarray]) -> None:
    """Write named arrays as one .npz file with a checksum."""
    archive = io.BytesIO()
    np.savez(archive, allow_pickle=False, **arrays)  # type: ignore[arg-type]
    # The last two bytes of an archive are the length of its comment.
    body = archive.getvalue()[:-2] + SHA256_DIGITS.to_bytes(2, "little")
    digest = hashlib.sha256(body).hexdigest().encode()
    write_atomically(path, lambda file: (file.write(body), file.write(digest)))


def read_arrays(path: Path) -> dict[str, np.ndarray]:
    """The arrays of a file that `write_arrays` wrote; FileNotFoundError or Damaged."""
    content = _read(path)
    body, digest = content[:-SHA256_DIGITS], content[-SHA256_DIGITS:]
    if hashlib.sha256(body).hexdigest().encode() != digest:
        raise Damaged("its checksum does not match")
    try:
        with np.load(io.BytesIO(content), allow_pickle=False) as data:
            return {name: data[name] for name in data.files}
    except (ValueError, zipfile.BadZipFile) as error:  # as of a pickle
        raise Damaged(first_line(error)) from None


def write_record(path: Path, values: Mapping[str, Any]) -> None:
    """Write a mapping of JSON types, one value a line, with a checksum."""
    lines = (
        f"{json.dumps(name)}: {json.dumps(value, allow_nan=False)}"
        for name, value in values.items()
    )
    text = _with_checksum("{\n" + ",\n".join(lines))
    write_atomically(path, lambda file: file.write(text.encode()))


def read_record(path: Path) -> dict[str, Any]:
    """The mapping in a file that `write_record` wrote; FileNotFoundError or Damaged."""
    try:
        text = _read(path).decode()
        values = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise Damaged(first_line(error)) from None
    body, key, _ = text.rpartition(CHECKSUM_KEY)
    if not isinstance(values, dict) or not key:
        raise Damaged("it has no checksum, as files of older versions")
    if text != _with_checksum(body):
        raise Damaged("its checksum does not match")
    del values["checksum"]
    return values


def _with_checksum(body: str) -> str:
    """The text of a record from its values, which `body` holds."""
    digest = hashlib.sha256(body.encode()).hexdigest()[:16]
    return f'{body}{CHECKSUM_KEY}{digest}"\n}}\n'


def _read(path: Path) -> bytes:
    """The bytes of a file; Damaged where it cannot be read."""
    try:
        return path.read_bytes()
    except FileNotFoundError:
        raise
    except (OSError, MemoryError) as error:
        raise Damaged(first_line(error)) from None
