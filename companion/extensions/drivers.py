"""Drivers of an episode: straight to the goal, or by plans of a model or simulator."""

from __future__ import annotations

import functools
import time
from typing import Any, NamedTuple

import numpy as np
import torch
from torch import Tensor

from companion.extensions.planning import ModelImagination, Planner, steer_to_goal
from sidm.drives import CONTROL_STEP, POSITION, QUATERNION, upright

ARRIVED = 0.5  # m, a robot this near to the goal has arrived
UPSIDE_DOWN = (1.0, 0.0, 0.0, 0.0)  # quaternion x, y, z, w


class DrivenEpisode(NamedTuple):
    """An episode of K control steps that was driven to its end."""

    ended: str  # 'arrived', a cause of `shards.DISCARDS`, or 'time'
    states: np.ndarray  # (K + 1, 13)
    actions: np.ndarray  # (K, 2)


class Driver:
    """Chooses the actions of an episode with a goal (2,), m.

    A planner makes the plans to carry out; without one the driver goes straight to the
    goal. Where plans lead is predicted by a learned model's `ModelImagination`, or by
    the simulator in which the robot drives.
    """

    def __init__(
        self, goal: np.ndarray, planner: Planner | None = None, imagination: Any = None
    ) -> None:
        self.goal, self.planner, self.imagination = goal, planner, imagination
        # s of computing, a value a plan; includes the update of the model's memory
        self.pace: list[float] = []
        # m, from the planned to the actual position, a value a plan after the first
        self.surprises: list[float] = []
        self._ready: list[Tensor] = []  # planned actions not yet carried out

    def act(self, state: np.ndarray) -> np.ndarray:
        """The action (2,) in a state (13,)."""
        if self.planner is None:
            return steer_to_goal(state, self.goal)
        if not self._ready:
            self._ready = self._plan(self.planner, state)
        action = self._ready.pop(0).numpy()
        if isinstance(self.imagination, ModelImagination):
            self.imagination.observe(state, action)
        return action

    def _plan(self, planner: Planner, state: np.ndarray) -> list[Tensor]:
        """The actions (2,) until the next plan."""
        steps = planner.settings.replan
        if planner.foreseen is not None:
            expected = planner.foreseen[steps, :2].numpy()
            distance = np.linalg.norm(expected - state[POSITION][:2])
            self.surprises.append(float(distance))
        start = time.perf_counter()
        imagine = functools.partial(simulate_sequences, self.imagination)
        if isinstance(self.imagination, ModelImagination):
            imagine = functools.partial(self.imagination.imagine, state)
        plan = planner.plan(imagine)
        self.pace.append(time.perf_counter() - start)
        return list(plan[:steps])


def drive_episode(
    simulator: Any, driver: Driver, rules: Any, longest: float
) -> DrivenEpisode:
    """Drive one episode to its end: at the goal, by the rules, or after `longest` s.

    The simulator is in the state in which the episode begins; the rules are those of
    data collection.
    """
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
    return DrivenEpisode(ended, np.array(states), np.array(actions))


def simulate_sequences(simulator: Any, actions: Tensor) -> Tensor:
    """States (N, H + 1, 13) under action sequences (N, H, 2), the present state first.

    A sequence ends early when the robot rolls over or when its state is not finite. The
    robot then stays upside down for the remaining steps. The simulator is left in its
    present state.
    """
    present = simulator.save()
    paths = []
    for sequence in actions.numpy():
        path = [simulator.restore(present)]
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
    simulator.restore(present)
    simulator.forget(present)
    return torch.from_numpy(np.array(paths))
