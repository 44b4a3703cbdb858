"""What users hand over as drives, brought to one type or refused in one line."""

from __future__ import annotations

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
    given: Drives, body: BodyLike | None, what: str, topics: Sequence[str] = (), held: bool = False
) -> list[Drive]:
    """Drives from what stands for them.

    Args:
        given: drives; a file, a ROS bag or a folder, or several; or a table in memory.
        body: what they are made of; drives that are read already may do without.
        what: the name of the argument, for messages.
        topics: of ROS bags that are read, where several could be meant.
        held: as of `recordings.read_drives`.

    Raises:
        ConfigError: there are no drives, or nothing says what they are made of.
        RecordingError: the first fault of a file or a table.
        TypeError: something else than drives.
    """
    if isinstance(given, (str, Path)):
        return read_drives(given, _wanted(body, what), topics, held)
    if isinstance(given, Drive):
        given = [given]
    if hasattr(given, "columns") and hasattr(given, "to_numpy"):
        return drives_from_frame(given, _wanted(body, what))
    if not isinstance(given, Sequence) or not all(isinstance(one, (Drive, str, Path)) for one in given):
        kinds = "drives, as sidm.simulate and sidm.read_drives give them, or paths of them"
        raise TypeError(f"{what} must be {kinds}, not {type(given).__name__}")
    if not given:
        raise ConfigError(f"{what} has no drives")
    own = None if body is None else as_body(body)
    found: list[Drive] = []
    for one in given:
        if not isinstance(one, Drive):
            found += read_drives(one, _wanted(own, what), topics, held)
        else:
            found.append(one if own in (None, one.body) else replace(one, body=own))
    if len({drive.body for drive in found}) > 1:
        names = ", ".join(sorted({drive.body.name for drive in found}))
        raise ConfigError(f"{what} has drives of several bodies ({names}); those of one robot have one")
    return found


def _wanted(body: BodyLike | None, what: str) -> Body:
    if body is None:
        name = "body" if what != "expert" else "expert_body"
        raise ConfigError(f"{what} is read from a file: say what its drives are made of, as {name}='robot.yaml'")
    return as_body(body)


def refuse_swapped(novice: Sequence[Drive], expert: Sequence[Drive] | None) -> None:
    """ConfigError where the novice's drives are a simulated expert's, or the expert's a novice's of the same pair."""
    for what, role, drives in (("novice", "expert", novice), ("expert", "novice", expert or ())):
        if drives and drives[0].robot.endswith(f" {role}"):
            if what == "novice" and expert is None:
                continue  # any robot can be learnt alone
            raise ConfigError(f"{what} has the drives of '{drives[0].robot}': are novice and expert swapped?")
