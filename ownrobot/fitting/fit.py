"""Fit a model to drives (`ownrobot.fit`)."""

from __future__ import annotations

import contextlib
import shutil
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import torch

from ownrobot.fitting.arguments import drives_from, robots_from
from ownrobot.fitting.errors import score_of
from ownrobot.fitting.files import ABOUT, refuse_folder
from ownrobot.fitting.learning import (
    NOTHING,
    refuse_method,
    settings_with,
    without_effect,
)
from ownrobot.fitting.model import Model
from ownrobot.fitting.single import fit_drives
from ownrobot.fitting.splits import Split, evaluation_splits
from sidm.config import ConfigError, Notice, first_line
from sidm.drives import Drive
from sidm.settings import Network, Training

if TYPE_CHECKING:
    from ownrobot.fitting.arguments import BodyLike, Drives

UNFINISHED = "unfinished"  # subfolder of the model's, for the state of a training


def fit(
    novice: Drives,
    expert: Drives | None = None,
    method: str = "least_squares",
    *,
    body: BodyLike | None = None,
    expert_body: BodyLike | None = None,
    network: Network | None = None,
    training: Training | None = None,
    settings: Mapping[str, Any] = NOTHING,
    test: Drives | float | None = None,
    seed: int = 0,
    out: str | Path | None = None,
    force: bool = False,
    topics: Sequence[str] = (),
    skip_bad: bool = False,
    device: str = "cpu",
    progress: bool = True,
) -> Model:
    """Fit a model of a robot to its drives, and to an expert's drives if there are any.

    Args:
        novice: drives of the robot, as `sidm.simulate` and `ownrobot.read_drives`
            return them; or a file, a ROS bag or a folder of drives, or several; or a
            pandas table.
        expert: drives of another robot, whose motion is cheaper to record.
        method: a name in `ownrobot.methods.registry.METHODS`.
        body: what the novice's drives are made of, needed where they come from files: a
            body, its YAML file or a mapping.
        expert_body: what the expert's drives are made of; by default `body`.
        network: sizes of the networks; the robots' bodies are put in.
        training: settings of the training; they replace the tuned values of the
            methods.
        settings: single settings of network and training by name, as
            `{"hidden": 64, "p_expert": 0.5}`.
        test: drives of the robot to evaluate the model on; or a share of the novice's
            sessions to hold out for that, below 1. With fewer than eight sessions (or
            drives, of a single session), models of folds are evaluated instead, and the
            model learns from all drives. By default nothing is held out.
        seed: seed of the choice of drives, the initial weights and the batches.
        out: a folder for the model. An unfinished training is kept there, too; the same
            call resumes it.
        force: whether the model may replace a model of another body in `out`.
        topics: topics of ROS bags, needed if a bag has several matching topics.
        skip_bad: whether to leave out drives that have a fault, with a `Notice` each.
        device: where networks are trained, as 'cpu' or 'cuda'.
        progress: whether to show a progress bar, with the longest time left.

    Returns:
        The model. It is also written to `out` if a folder is given. `held_out` is its
        loss on the drives of `test`; None without any, or with too few.

    Raises:
        RecordingError: the first fault of a file of drives.
        ConfigError: these robots cannot be learnt with the body, the method or a
            setting.
        TypeError: `novice` or `expert` is nothing that holds drives.

    Examples:
        >>> drives = ownrobot.read_drives(
        ...     "recordings/warthog.csv.gz", body="recordings/skid_steer.yaml"
        ... )
        >>> model = ownrobot.fit(drives, method="least_squares", test=0.25)
        >>> model
        Model('least_squares' of body 'skid-steered', from 6.8 min)
        >>> model.held_out.sessions
        24
    """
    chosen = settings_with(network, training, settings)
    _refuse_device(device)
    if seed < 0:
        raise ConfigError(f"seed must be 0 or more, not {seed}")
    reading: dict[str, Any] = {"topics": topics, "skip_bad": skip_bad}
    drives, experts = robots_from(novice, expert, body, expert_body, **reading)
    novice_body = drives[0].body
    refuse_method(method, novice_body, experts[0].body if experts else None)
    if text := without_effect([method], settings, novice_body, device):
        warnings.warn(Notice(text), stacklevel=2)
    if out is not None:
        refuse_folder(out, novice_body, force)
    learnt, held_out, folds = _split(drives, test, seed, reading)
    judging = [*held_out, *(drive for part in folds for drive in part.held_out)]
    known = {drive.states.tobytes() for drive in experts or ()}
    if seen := sum(drive.states.tobytes() in known for drive in judging):
        text = (
            f"{seen} of {len(judging)} drives held out are among the expert's, too: "
            "the loss on them looks too small"
        )
        warnings.warn(Notice(text), stacklevel=2)
    state = None if out is None else Path(out) / UNFINISHED / method
    how: dict[str, Any] = {"seed": seed, "progress": progress, "device": device}
    model = fit_drives(learnt, experts, method, chosen, state=state, **how)
    losses = [model.losses(held_out)] if held_out else []
    for number, (part, rest) in enumerate(folds):
        how |= {"state": state and state / f"fold{number}", "notify": False}
        losses.append(fit_drives(part, experts, method, chosen, **how).losses(rest))
    if losses:
        import pandas as pd

        joined = pd.concat(losses, ignore_index=True)
        model = replace(model, held_out=score_of(joined, len(losses)))
    if out is not None:
        if (Path(out) / ABOUT).exists():
            warnings.warn(Notice(f"{out}: the model there is replaced"), stacklevel=2)
        model.save(out, force=force)
        shutil.rmtree(Path(out) / UNFINISHED / method, ignore_errors=True)
        with contextlib.suppress(OSError):  # another method's training stays
            (Path(out) / UNFINISHED).rmdir()
    return model


def _split(
    novice: list[Drive],
    test: Drives | float | None,
    seed: int,
    reading: Mapping[str, Any],
) -> tuple[list[Drive], list[Drive], list[Split]]:
    """The drives to learn from, the drives to evaluate on, and splits of folds."""
    if test is None:
        return novice, [], []
    if isinstance(test, (int, float)):
        if not 0 < test < 1:
            raise ConfigError(f"test must be drives or a share below 1, not {test}")
        splits = evaluation_splits(novice, test, seed)
        return (*splits[0], []) if len(splits) == 1 else (novice, [], splits)
    body = novice[0].body
    held_out = drives_from(test, body, "test", allow_constant=True, **reading)
    learnt = {drive.states.tobytes() for drive in novice}
    for drive in held_out:
        if drive.states.tobytes() in learnt:
            raise ConfigError(
                f"test has {drive.name}, which the model learns from; "
                "pass other drives, or a share"
            )
    shared = {drive.session for drive in novice} & {d.session for d in held_out}
    if names := sorted(shared - {""}):
        text = (
            f"test has sessions that the model learns from ({', '.join(names)}); "
            "if they are the same outings, the loss looks too small"
        )
        warnings.warn(Notice(text), stacklevel=3)
    return novice, held_out, []


def _refuse_device(device: str) -> None:
    try:
        torch.zeros(1, device=device)
    except (RuntimeError, AssertionError) as error:
        raise ConfigError(
            f"device '{device}' cannot be used ({first_line(error)}); take cpu or cuda"
        ) from None
