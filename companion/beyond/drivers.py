"""Who drives an episode: straight ahead, or by plans that a model or the simulator imagines."""

from __future__ import annotations

import functools
import time
from typing import Any, NamedTuple

import numpy as np
import torch
from torch import Tensor

from companion.beyond.planning import Dreamer, Planner, straight
from sidm.drives import CONTROL_STEP, POSITION, QUATERNION, TWIST, upright

ARRIVED = 0.5  # m from the goal
UPSIDE_DOWN = (1.0, 0.0, 0.0, 0.0)  # a quaternion


class Ride(NamedTuple):
    """An episode that was driven: K control steps."""

    ended: str  # 'arrived', a cause of `trajectory.DISCARDS`, or 'time'
    states: np.ndarray  # (K + 1, 13)
    actions: np.ndarray  # (K, 2)
    #: m, from where a plan led to where the robot was at the next, mean; 0 of no plan
    surprise: float

    @property
    def path(self) -> np.ndarray:
        """(K + 1, 2) x and y, m."""
        return self.states[:, POSITION][:, :2]

    @property
    def seconds(self) -> float:
        """Of driving."""
        return CONTROL_STEP * len(self.actions)

    @property
    def top_speed(self) -> float:
        """Forward and sideways together, m/s."""
        return float(np.linalg.norm(self.states[:, TWIST][:, :2], axis=1).max())

    @property
    def length(self) -> float:
        """Of the path, m."""
        return float(np.linalg.norm(np.diff(self.path, axis=0), axis=1).sum())

    @property
    def steepest(self) -> float:
        """Tilt, degrees."""
        return float(np.degrees(np.arccos(np.clip(upright(self.states), -1, 1)).max()))


class Driver:
    """What acts.

    Args:
        goal: (2,) x and y, m.
        planner: whose plans are carried out; None drives straight ahead.
        imagination: of the plans, a learned model's or the simulator that is driven in.
    """

    def __init__(
        self, goal: np.ndarray, planner: Planner | None = None, imagination: Any = None
    ) -> None:
        self.goal, self.planner, self.imagination = goal, planner, imagination
        # s, of each plan, what was done since the one before taken in
        self.pace: list[float] = []
        # m, from where a plan led to where the robot was at the next
        self.surprises: list[float] = []
        self._ready: list[Tensor] = []

    @property
    def surprise(self) -> float:
        """Mean over the plans, m."""
        return float(np.mean(self.surprises)) if self.surprises else 0.0

    def act(self, state: np.ndarray) -> np.ndarray:
        """The action (2,) in a state (13,)."""
        if self.planner is None:
            return straight(state, self.goal)
        if not self._ready:
            self._ready = self._plan(self.planner, state)
        action = self._ready.pop(0).numpy()
        if isinstance(self.imagination, Dreamer):
            self.imagination.observe(state, action)
        return action

    def _plan(self, planner: Planner, state: np.ndarray) -> list[Tensor]:
        """The actions until the next plan."""
        steps, dreamer = planner.settings.replan, self.imagination
        if planner.foreseen is not None:
            self.surprises.append(
                float(
                    np.linalg.norm(
                        planner.foreseen[steps, :2].numpy() - state[POSITION][:2]
                    )
                )
            )
        start = time.perf_counter()
        if isinstance(dreamer, Dreamer):
            plan = planner.plan(functools.partial(dreamer.imagine, state))
        else:
            plan = planner.plan(functools.partial(try_out, self.imagination))
        self.pace.append(time.perf_counter() - start)
        return list(plan[:steps])


def ride(simulator: Any, driver: Driver, rules: Any, longest: float) -> Ride:
    """Drive one episode to its end: the goal, an end by the `rules` of collecting, or `longest`, s."""
    actions: list[np.ndarray] = []
    states, ended = [simulator.state], "time"
    while ended == "time" and len(actions) < round(longest / CONTROL_STEP):
        action = driver.act(states[-1])
        state = simulator.step(action)
        actions.append(action)
        cause = rules.ended(state)
        states.append(state if np.isfinite(state).all() else states[-1])
        if cause or np.linalg.norm(states[-1][POSITION][:2] - driver.goal) < ARRIVED:
            ended = cause or "arrived"
    return Ride(ended, np.array(states), np.array(actions), driver.surprise)


def try_out(simulator: Any, actions: Tensor) -> Tensor:
    """Where actions (N, H, 2) lead, tried out in the simulator one sequence after the other: (N, H + 1, 13).

    A sequence that has rolled over is not tried further, nor one whose numbers are
    lost: it stays upside down.
    """
    now = simulator.save()
    paths = []
    for sequence in actions.numpy():
        path = [simulator.restore(now)]
        for action in sequence:
            state = simulator.step(action)
            lost = not np.isfinite(state).all()
            path.append(path[-1].copy() if lost else state)
            if lost:
                path[-1][QUATERNION] = UPSIDE_DOWN
            if upright(path[-1]) < 0:
                path += [path[-1]] * (len(sequence) + 1 - len(path))
                break
        paths.append(np.array(path))
    simulator.restore(now)
    simulator.forget(now)
    return torch.from_numpy(np.array(paths))
