"""What users hand over as drives, brought to one type or refused in one line."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

from sidm.body import Body, as_body
from sidm.config import ConfigError, replace
from sidm.drives import Drive
from sidm.recordings.reading import drives_from_frame, read_drives

if TYPE_CHECKING:
    import pandas as pd

    Drives: TypeAlias = str | Path | Drive | pd.DataFrame | Sequence[Drive | str | Path]
    BodyLike: TypeAlias = Body | str | Path | Mapping[str, Any]


def drives_from(
    given: Drives,
    body: BodyLike | None,
    what: str,
    topics: Sequence[str] = (),
    held: bool = False,
    otherwise: BodyLike | None = None,
) -> list[Drive]:
    """Drives from what stands for them.

    Args:
        given: drives; a file, a ROS bag or a folder, or several; or a table in memory.
        body: what they are made of; drives that are read already may do without, and
            must be made of the same.
        what: the name of the argument, for messages.
        topics: of ROS bags that are read, where several could be meant.
        held: as of `recordings.read_drives`.
        otherwise: what drives in files are made of where no `body` is given.

    Raises:
        ConfigError: there are no drives, nothing says what they are made of, or they
            are made of something else.
        RecordingError: the first fault of a file or a table.
        TypeError: something else than drives.
    """
    if isinstance(given, (str, Path)):
        return read_drives(given, _wanted(body or otherwise, what), topics, held)
    if isinstance(given, Drive):
        given = [given]
    if hasattr(given, "columns") and hasattr(given, "to_numpy"):
        return drives_from_frame(given, _wanted(body or otherwise, what))
    if not isinstance(given, Sequence) or not all(
        isinstance(one, (Drive, str, Path)) for one in given
    ):
        kinds = (
            "drives, as sidm.simulate and sidm.read_drives give them, or paths of them"
        )
        raise TypeError(f"{what} must be {kinds}, not {type(given).__name__}")
    if not given:
        raise ConfigError(f"{what} has no drives")
    own = None if body is None else as_body(body)
    found: list[Drive] = []
    for one in given:
        if not isinstance(one, Drive):
            found += read_drives(one, _wanted(own or otherwise, what), topics, held)
        else:
            found.append(one if own is None else _as_made_of(one, own, what))
    if len({drive.body for drive in found}) > 1:
        names = ", ".join(sorted({drive.body.name for drive in found}))
        raise ConfigError(
            f"{what} has drives of several bodies ({names}); those of one robot have one"
        )
    return found


def _wanted(body: BodyLike | None, what: str) -> Body:
    if body is None:
        name = "body" if what != "expert" else "expert_body"
        raise ConfigError(
            f"say what the drives of {what} are made of, as {name}='robot.yaml'"
        )
    return as_body(body)


def _as_made_of(drive: Drive, body: Body, what: str) -> Drive:
    """A drive with a body whose numbers are the same, such as one with other weights; ConfigError for another body."""
    for name, own, wanted in (
        ("pose", drive.body.pose, body.pose),
        ("state", *([column for column, _ in one.state] for one in (drive.body, body))),
        (
            "actions",
            *([column for column, _ in one.actions] for one in (drive.body, body)),
        ),
    ):
        if own != wanted:
            raise ConfigError(
                f"{what} has drives of '{drive.body.name}', whose {name} is not that of '{body.name}'"
            )
    if not math.isclose(drive.body.rate, body.rate, rel_tol=1e-3):
        raise ConfigError(
            f"{what} has drives at {drive.body.rate:g} Hz, body '{body.name}' is at {body.rate:g} Hz"
        )
    return drive if drive.body == body else replace(drive, body=body)


def refuse_swapped(novice: Sequence[Drive], expert: Sequence[Drive] | None) -> None:
    """ConfigError where the novice's drives are a simulated expert's, or the expert's a simulated novice's."""
    for what, role, drives in (
        ("novice", "expert", novice),
        ("expert", "novice", expert or ()),
    ):
        if drives and drives[0].robot.endswith(f" {role}"):
            if what == "novice" and expert is None:
                continue  # any robot can be learnt alone
            raise ConfigError(
                f"{what} has the drives of '{drives[0].robot}': are novice and expert swapped?"
            )
