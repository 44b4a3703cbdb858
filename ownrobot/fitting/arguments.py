"""Drives that users pass in: checked, and brought into one type."""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from ownrobot.body_file import as_body
from ownrobot.recordings.reading import has_bags, is_table, read_drives
from sidm.body import Body, kind_of
from sidm.config import ConfigError, Notice, counted, replace
from sidm.drives import Drive, Ground

if TYPE_CHECKING:
    import pandas as pd

    Drives: TypeAlias = (
        str | Path | Drive | pd.DataFrame | Sequence[Drive] | Sequence[str | Path]
    )
    BodyLike: TypeAlias = Body | str | Path | Mapping[str, Any]


def drives_from(
    source: Drives,
    body: BodyLike | None,
    argument: str,
    topics: Sequence[str] = (),
    allow_constant: bool = False,
    default_body: BodyLike | None = None,
    skip_bad: bool = False,
) -> list[Drive]:
    """The drives of one body from any form in which a user can pass them.

    `argument` is its name in messages. Drives that have been read already need no body;
    one that is given must have the same pose, state, actions and rate. Those of files
    have `default_body` where `body` is None.
    """
    several = isinstance(source, Sequence) and not isinstance(source, str)
    items: Sequence[Any] = source if several else [source]  # type: ignore[assignment]
    are_paths = bool(items) and all(isinstance(item, (str, Path)) for item in items)
    if are_paths or is_table(source):
        described = body or default_body
        if described is None:
            option = "body" if argument != "expert" else "expert_body"
            raise ConfigError(
                f"the drives of {argument} have no body: pass {option}='robot.yaml'"
            )
        if are_paths and argument in ("expert", "test") and not has_bags(items):
            topics = ()  # are of the novice's bags
        paths: Any = source
        own = as_body(described)
        drives = read_drives(paths, own, topics, allow_constant, skip_bad)
        return _each_once(drives, argument)
    if not all(isinstance(item, Drive) for item in items):
        raise TypeError(
            f"{argument} must be drives, as sidm.simulate and ownrobot.read_drives "
            f"return, or paths of drives, not {type(source).__name__}"
        )
    if not items:
        raise ConfigError(f"{argument} has no drives")
    expected = None if body is None else as_body(body)
    drives = []
    for drive in items:
        _refuse_not_finite(drive, argument)
        moved = _over_middle(drive)
        drives.append(
            moved if expected is None else _with_body(moved, expected, argument)
        )
    if len({drive.body for drive in drives}) > 1:
        names = ", ".join(sorted({drive.body.name for drive in drives}))
        raise ConfigError(
            f"{argument} has drives of several bodies ({names}); "
            "all drives of a robot have the same body"
        )
    return _each_once(drives, argument)


def robots_from(
    novice: Drives,
    expert: Drives | None,
    body: BodyLike | None,
    expert_body: BodyLike | None,
    **reading: Any,
) -> tuple[list[Drive], list[Drive] | None]:
    """Drives of a robot, and of an expert if there is one, as users pass them."""
    if expert is None and expert_body is not None:
        raise ConfigError("expert_body is given, but there is no expert")
    drives = drives_from(novice, body, "novice", **reading)
    if expert is None:  # any robot can be learnt alone, an expert's too
        return drives, None
    others = drives_from(expert, expert_body, "expert", default_body=body, **reading)
    for argument, other_role, first in (
        ("novice", "expert", drives[0]),
        ("expert", "novice", others[0]),
    ):
        if first.robot.endswith(f" {other_role}"):
            raise ConfigError(
                f"{argument} has the drives of '{first.robot}': "
                "are novice and expert swapped?"
            )
    return drives, others


def _refuse_not_finite(drive: Drive, argument: str) -> None:
    body = drive.body
    for kind, columns in (("states", body.state), ("actions", body.actions)):
        bad = np.argwhere(~np.isfinite(np.asarray(getattr(drive, kind), float)))
        if len(bad):
            step, number = bad[0]
            raise ConfigError(
                f"{argument} has {drive!r} in which '{columns[number][0]}' of step "
                f"{step} is not finite; mend it, or cut the drive there"
            )


def _over_middle(drive: Drive) -> Drive:
    """The drive moved so that the middle of its ground is the origin, as in files."""
    ground = drive.ground
    if not isinstance(ground, Ground) or ground.centre == (0.0, 0.0):
        return drive
    states = drive.states.copy()
    if drive.body.pose_size:
        states[:, :2] -= np.array(ground.centre)
    return replace(drive, states=states, ground=ground._replace(centre=(0.0, 0.0)))


def _each_once(drives: list[Drive], argument: str) -> list[Drive]:
    """The drives without those that are given twice, which are told by a `Notice`."""
    different: dict[tuple[bytes, bytes], Drive] = {}
    for drive in drives:
        key = drive.states.tobytes(), drive.actions.tobytes()
        different.setdefault(key, drive)
    if len(different) < len(drives):
        twice = len(drives) - len(different)
        text = f"{argument} has {counted(twice, 'drive')} given twice; each counts once"
        warnings.warn(Notice(text), stacklevel=5)
    return list(different.values())


def _with_body(drive: Drive, body: Body, argument: str) -> Drive:
    """The drive with `body`, which must describe the same numbers.

    The two bodies may differ in other things, such as the weights of the loss.
    """

    def layout(one: Body) -> dict[str, Any]:
        parts = {"state": one.state, "actions": one.actions}
        kinds = {
            part: [(name, kind_of(unit) or unit) for name, unit in columns]
            for part, columns in parts.items()
        }
        return {"pose": one.pose} | kinds

    expected = layout(body)
    for name, value in layout(drive.body).items():
        if value != expected[name]:
            raise ConfigError(
                f"{argument} has drives of body '{drive.body.name}', "
                f"which differs from body '{body.name}' in its {name}"
            )
    if not math.isclose(drive.body.rate, body.rate, rel_tol=1e-3):
        raise ConfigError(
            f"{argument} has drives at {drive.body.rate:g} Hz, "
            f"but body '{body.name}' is at {body.rate:g} Hz"
        )
    return drive if drive.body == body else replace(drive, body=body)
