"""Files that are there whole or not at all, and that show when a byte of them has changed. No pickle.

Arrays lie in an .npz archive whose comment is the SHA-256 of everything before it; any
reader of .npz reads them. Records are JSON whose last value is such a checksum of the
text before it.
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
except ImportError:  # Windows: two processes may make the same, each alike
    fcntl = None  # type: ignore[assignment]

SEAL = 64  # hexadecimal digits of SHA-256
LARGEST_RECORD = 2**24  # bytes
MARK = ',\n"checksum": "'


class Damaged(ValueError):
    """A file that is not what was written; the message is one line without the file's name."""


def write_atomically(path: Path, write: Callable[[IO[bytes]], object]) -> None:
    """Call `write(file)` on a new file beside `path`, force it to disk and move it into place.

    Raises:
        OSError: it cannot be written, as on a full disk; one line that names `path`.
            What was there before stays.
    """
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
        raise OSError(
            f"{path}: cannot be written ({error.strerror or error})"
        ) from error
    finally:
        if part is not None:
            with contextlib.suppress(FileNotFoundError):
                os.unlink(part)


def _sync_folder(folder: Path) -> None:
    """Force the new name itself to disk."""
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


@contextlib.contextmanager
def locked(path: Path) -> Iterator[None]:
    """Let a single process of this machine make the file or folder `path`; the others wait."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with open(path.parent / f".{path.name}.lock", "wb") as lock:
        if fcntl is not None:
            with contextlib.suppress(OSError):  # a file system without locks
                fcntl.flock(lock, fcntl.LOCK_EX)
        yield


def checksum(array: np.ndarray) -> str:
    """16 hexadecimal digits that change when any byte, the shape or the type of `array` does."""
    digest = hashlib.sha256(f"{array.dtype.str}{array.shape}".encode())
    digest.update(np.ascontiguousarray(array).data)
    return digest.hexdigest()[:16]


def sweep(folder: Path, age: float = 3600.0) -> None:
    """Delete what killed writers left in `folder` more than `age` seconds ago."""
    for part in folder.glob(".*.part"):
        with contextlib.suppress(OSError):
            if time.time() - part.stat().st_mtime > age:
                part.unlink()


def write_arrays(path: Path, arrays: Mapping[str, np.ndarray]) -> None:
    """Write named arrays as one sealed .npz file."""
    archive = io.BytesIO()
    np.savez(archive, allow_pickle=False, **arrays)  # type: ignore[arg-type]
    # the comment's length ends the archive
    body = archive.getvalue()[:-2] + SEAL.to_bytes(2, "little")
    write_atomically(
        path,
        lambda file: (
            file.write(body),
            file.write(hashlib.sha256(body).hexdigest().encode()),
        ),
    )


def read_arrays(path: Path) -> dict[str, np.ndarray]:
    """What `write_arrays` wrote.

    Raises:
        FileNotFoundError: there is no such file.
        Damaged: it is not as it was written.
    """
    content = _content(path)
    if hashlib.sha256(content[:-SEAL]).hexdigest().encode() != content[-SEAL:]:
        raise Damaged("its checksum does not match")
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            if any(
                member.compress_type != zipfile.ZIP_STORED
                for member in archive.infolist()
            ):
                raise Damaged("compressed")
        with np.load(io.BytesIO(content), allow_pickle=False) as data:
            arrays = {name: data[name] for name in data.files}
    except (
        ValueError,
        KeyError,
        EOFError,
        MemoryError,
        OSError,
        zipfile.BadZipFile,
        NotImplementedError,
    ) as error:
        raise Damaged(first_line(error)) from None
    # NumPy gives other members as bytes
    if not all(isinstance(array, np.ndarray) for array in arrays.values()):
        raise Damaged("it holds something else than arrays")
    return arrays


def write_record(path: Path, values: Mapping[str, Any]) -> None:
    """Write a mapping of JSON types, a line a value, and its checksum.

    Raises:
        ValueError: a number is not finite.
    """
    lines = (
        f"{json.dumps(name)}: {json.dumps(value, allow_nan=False)}"
        for name, value in values.items()
    )
    body = "{\n" + ",\n".join(lines)
    text = f'{body}{MARK}{hashlib.sha256(body.encode()).hexdigest()[:16]}"\n}}\n'
    write_atomically(path, lambda file: file.write(text.encode()))


def read_record(path: Path) -> dict[str, Any]:
    """What `write_record` wrote.

    Raises:
        FileNotFoundError: there is no such file.
        Damaged: it is not as it was written.
    """
    try:
        text = _content(path, LARGEST_RECORD).decode()
        values = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise Damaged(first_line(error)) from None
    body, mark, _ = text.rpartition(MARK)
    if not isinstance(values, dict) or not mark:
        raise Damaged("it has no checksum, as files of older versions")
    if text != f'{body}{MARK}{hashlib.sha256(body.encode()).hexdigest()[:16]}"\n}}\n':
        raise Damaged("its checksum does not match")
    del values["checksum"]
    return values


def _content(path: Path, most: int | None = None) -> bytes:
    try:
        if most is not None and path.stat().st_size > most:
            raise Damaged(f"it is larger than {most} bytes")
        return path.read_bytes()
    except FileNotFoundError:
        raise
    except (OSError, MemoryError) as error:
        raise Damaged(first_line(error)) from None
