"""Planning with the cross-entropy method over action sequences.

The method works on whatever predicts where action sequences lead.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import torch
from torch import Tensor

from sidm import rotations
from sidm.config import config
from sidm.drives import ACTION_SIZE, POSITION, QUATERNION, STEPS, upright
from sidm.learning.model import Predictor
from sidm.learning.networks import Memory
from sidm.learning.observation import encode_inputs, integrate, robot_centred_map

#: From action sequences (N, H, 2) to the states (N, H + 1, 13) to which they lead, the
#: present state first.
Imagination = Callable[[Tensor], Tensor]

#: Between these values lie 99 % of the throttles of the novices' data.
SLOWEST, FASTEST = -0.2, 0.6
#: Cost, m, of each step of a sequence that tilts beyond the steepest tilt.
ROLLED_OVER = 100.0


@config
class Planning:
    """Settings of a planner by the cross-entropy method.

    The distribution of the action sequences is kept from plan to plan and shifted in
    time.
    """

    samples: int = 32  # action sequences an iteration
    #: a plan; each samples from the distribution of the elites before, the first from
    #: that of the last plan
    iterations: int = 1
    elites: int = 6  # best samples, whose mean and standard deviation are taken
    horizon: int = 9  # control steps of 0.1 s, a multiple of `hold`
    hold: int = 3  # control steps for which an action is held
    replan: int = 3  # control steps from plan to plan
    #: standard deviation at first, and of steps that no plan has reached yet
    spread: float = 0.5
    least: float = 0.2  # smallest standard deviation, so that the search goes on
    #: tilt, degrees, beyond which a sequence counts as a rollover; above 60 some robots
    #: still return
    steepest: float = 65.0
    slowest: float = SLOWEST  # smallest planned throttle
    fastest: float = FASTEST  # largest planned throttle


def cost(states: Tensor, goal: Tensor, steepest: float) -> Tensor:
    """Cost (N,), m, of imagined paths (N, H + 1, 13) to a goal (2,), m.

    It is the mean distance from the goal over the steps, plus the distance at the end,
    plus ROLLED_OVER for each step that tilts beyond `steepest`, degrees.
    """
    ahead = states[:, 1:]
    distance = (ahead[..., :2] - goal).norm(dim=-1)  # (N, H)
    over = upright(ahead) < math.cos(math.radians(steepest))
    return distance.mean(1) + distance[:, -1] + ROLLED_OVER * over.sum(1)


class Planner:
    """Plans repeatedly to a goal (2,), m; each starts from the last distribution."""

    def __init__(self, settings: Planning, goal: np.ndarray, seed: int) -> None:
        self.settings, self.goal = settings, torch.as_tensor(goal, dtype=torch.float64)
        self.generator = torch.Generator().manual_seed(seed)
        self.mean = torch.zeros(settings.horizon, ACTION_SIZE, dtype=torch.float64)
        self.spread = torch.full_like(self.mean, settings.spread)
        self.low, self.high = torch.tensor(
            [[settings.slowest, -1.0], [settings.fastest, 1.0]], dtype=torch.float64
        )
        # states (H + 1, 13) to which the last plan leads, as imagined
        self.foreseen: Tensor | None = None

    def plan(self, imagine: Imagination) -> Tensor:
        """Actions (H, 2) from now on; after the first `replan`, plan again."""
        settings, mean, spread = self.settings, self.mean, self.spread  # (H, 2)
        shape = settings.samples, settings.horizon // settings.hold, ACTION_SIZE
        best, lowest = mean, math.inf
        for _ in range(settings.iterations):
            noise = torch.randn(shape, generator=self.generator, dtype=torch.float64)
            noise = noise.repeat_interleave(settings.hold, dim=1)
            samples = (mean + spread * noise).clamp(self.low, self.high)  # (N, H, 2)
            samples[0] = mean
            paths = imagine(samples)
            costs = cost(paths, self.goal, settings.steepest)
            elite = costs.argsort(stable=True)[: settings.elites]
            mean = samples[elite].mean(0)
            spread = samples[elite].std(0, correction=0).clamp_min(settings.least)
            first = elite[0]
            if float(costs[first]) < lowest:
                best, lowest = samples[first], float(costs[first])
                self.foreseen = paths[first]
        ahead = slice(settings.replan, None)
        self.mean = torch.cat([mean[ahead], mean[-1:].expand(settings.replan, -1)])
        unseen = torch.full_like(spread[: settings.replan], settings.spread)
        self.spread = torch.cat([spread[ahead], unseen])
        return best


class ModelImagination:
    """Predicts paths with a learned model, which remembers the motion so far.

    The ground has heights (H, W), m; `horizon` steps are predicted from the robot's
    state.
    """

    def __init__(
        self, model: Predictor, heights: np.ndarray, pixels: int, horizon: int = 0
    ) -> None:
        self.model, self.pixels = model, pixels
        self.longest = STEPS - horizon  # steps of the memory
        self.heights = torch.as_tensor(heights, dtype=torch.float32)
        self.memory: Memory | None = None
        # states (13,) and actions (2,) in the memory, then those to be added
        self.done: list[tuple[Tensor, Tensor]] = []
        self.new = 0  # number of steps to be added to the memory

    def imagine(self, state: np.ndarray | Tensor, actions: Tensor) -> Tensor:
        """States (N, H + 1, 13) float64 to which actions (N, H, 2) lead.

        The robot's `state` (13,) is first in each path.
        """
        self.remember()
        count = len(actions)
        states = [torch.as_tensor(state, dtype=torch.float32).expand(count, -1)]
        memory = None
        if self.memory is not None:
            hidden, cell = (
                part.expand(-1, count, -1).contiguous() for part in self.memory
            )
            memory = hidden, cell
        with torch.inference_mode():
            for action in actions.float().unbind(1):
                predicted, memory = self._predict(
                    states[-1][:, None], action[:, None], memory
                )
                states.append(integrate(states[-1], predicted[:, 0]))
        return torch.stack(states, dim=1).double()

    def observe(self, state: np.ndarray, action: np.ndarray | Tensor) -> None:
        """Note that the robot took `action` (2,) in `state` (13,)."""
        seen, taken = (
            torch.as_tensor(one, dtype=torch.float32) for one in (state, action)
        )
        self.done.append((seen, taken))
        self.new += 1

    def remember(self) -> None:
        """Add the new steps to the memory.

        Memory and imagined path together are never longer than STEPS, the most that the
        model saw in training. When they would be, the memory starts again from half as
        many steps.
        """
        if len(self.done) > self.longest:
            self.done, self.memory = self.done[-self.longest // 2 :], None
            self.new = len(self.done)
        if self.new:
            states, actions = (
                torch.stack(values)[None]
                for values in zip(*self.done[-self.new :], strict=True)
            )
            with torch.inference_mode():
                _, self.memory = self._predict(states, actions, self.memory)
            self.new = 0

    def _predict(
        self, states: Tensor, actions: Tensor, memory: Memory | None
    ) -> tuple[Tensor, Memory]:
        """Transitions (N, T, 13) of states (N, T, 13) and actions (N, T, 2)."""
        maps = robot_centred_map(self.heights, states, self.pixels).half()
        return self.model("novice", encode_inputs(states, actions), maps, memory)


def steer_to_goal(state: np.ndarray, goal: np.ndarray) -> np.ndarray:
    """The action (2,) without a plan: constant throttle, steering to the goal."""
    x, y = np.asarray(goal) - np.asarray(state)[POSITION][:2]
    yaw = rotations.yaw(torch.as_tensor(state)[QUATERNION])
    bearing = rotations.wrap(torch.atan2(torch.tensor(y), torch.tensor(x)) - yaw)
    # positive steering turns right
    return np.array([FASTEST, np.clip(-1.5 * float(bearing), -1, 1)])
