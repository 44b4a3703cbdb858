"""Driving with a model: the cross-entropy method over action sequences, on whatever can imagine where they lead."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import torch
from torch import Tensor

from sidm import rotations
from sidm.config import ConfigError, config, refuse_below, refuse_nonsense
from sidm.drives import ACTION_SIZE, POSITION, QUATERNION, STEPS, upright
from sidm.learning.model import Predictor
from sidm.learning.networks import Memory
from sidm.learning.observation import encode_inputs, integrate, robot_centred_map

#: Where actions (N, H, 2) lead: states (N, H + 1, 13), the present one first.
Imagination = Callable[[Tensor], Tensor]

#: Between these lie 99 % of the throttles that the novices' data were collected with.
SLOWEST, FASTEST = -0.2, 0.6


@config
class Planning:
    """Settings of a planner: the cross-entropy method, its distribution kept from plan to plan and moved on in time."""

    samples: int = 32  # action sequences an iteration
    #: a plan; each draws from the distribution of the elites before, the first from the
    #: last plan's
    iterations: int = 1
    #: of the samples, the best ones, whose mean and standard deviation are taken
    elites: int = 6
    horizon: int = 9  # control steps of 0.1 s
    hold: int = 3  # control steps that an action lasts
    replan: int = 3  # control steps from plan to plan
    #: standard deviation at first, and of what a plan has not looked at yet
    spread: float = 0.5
    least: float = 0.2  # standard deviation that is kept, so that the search goes on
    #: degrees of tilt, beyond which a sequence counts as a rollover; from 60 some
    #: robots return
    steepest: float = 65.0
    slowest: float = SLOWEST  # throttle that is planned
    fastest: float = FASTEST

    def __post_init__(self) -> None:
        """Refuse settings that no plan can be made with."""
        refuse_nonsense(self)
        refuse_below(
            self, 1, "samples", "iterations", "elites", "horizon", "hold", "replan"
        )
        if self.elites > self.samples:
            raise ConfigError(
                f"Planning.elites must be at most samples ({self.samples}), not {self.elites}"
            )
        if self.horizon % self.hold:
            raise ConfigError(
                f"Planning.horizon must be a multiple of hold ({self.hold}), not {self.horizon}"
            )
        if self.replan > self.horizon:
            raise ConfigError(
                f"Planning.replan must be at most horizon ({self.horizon}), not {self.replan}"
            )
        for name in ("spread", "least"):
            if not getattr(self, name) > 0:
                raise ConfigError(
                    f"Planning.{name} must be positive, not {getattr(self, name)}"
                )
        if not -1 <= self.slowest < self.fastest <= 1:
            raise ConfigError(
                f"Planning: -1 <= slowest < fastest <= 1, not {self.slowest} and {self.fastest}"
            )


#: m, added to the cost of a sequence for every step beyond the steepest tilt
ROLLED_OVER = 100.0


def cost(states: Tensor, goal: Tensor, steepest: float) -> Tensor:
    """What imagined paths cost.

    Args:
        states: (N, H + 1, 13).
        goal: (2,) x and y, m.
        steepest: tilt, degrees.

    Returns:
        (N,), m: the distance from the goal, mean over the steps and once more at the
        end, and ROLLED_OVER for every step that tilts more.
    """
    ahead = states[:, 1:]
    distance = (ahead[..., :2] - goal).norm(dim=-1)  # (N, H)
    over = upright(ahead) < math.cos(math.radians(steepest))
    return distance.mean(1) + distance[:, -1] + ROLLED_OVER * over.sum(1)


class Planner:
    """Plans again and again towards one goal, each time from where the samples that did best before led.

    Args:
        settings: of the method.
        goal: (2,) x and y, m.
        seed: of the samples.
    """

    def __init__(self, settings: Planning, goal: np.ndarray, seed: int) -> None:
        self.settings, self.goal = settings, torch.as_tensor(goal, dtype=torch.float64)
        self.generator = torch.Generator().manual_seed(seed)
        self.mean = torch.zeros(settings.horizon, ACTION_SIZE, dtype=torch.float64)
        self.spread = torch.full_like(self.mean, settings.spread)
        self.low, self.high = torch.tensor(
            [[settings.slowest, -1.0], [settings.fastest, 1.0]], dtype=torch.float64
        )
        # (H + 1, 13), where the last plan leads by what imagined it
        self.foreseen: Tensor | None = None

    def plan(self, imagine: Imagination) -> Tensor:
        """Actions (H, 2) from now on; the first `replan` are to be carried out before the next plan."""
        settings, mean, spread = self.settings, self.mean, self.spread  # (H, 2)
        shape = settings.samples, settings.horizon // settings.hold, ACTION_SIZE
        best, lowest = mean, math.inf
        for _ in range(settings.iterations):
            noise = torch.randn(shape, generator=self.generator, dtype=torch.float64)
            # (N, H, 2)
            drawn = mean + spread * noise.repeat_interleave(settings.hold, dim=1)
            drawn = drawn.clamp(self.low, self.high)
            drawn[0] = mean
            paths = imagine(drawn)
            costs = cost(paths, self.goal, settings.steepest)
            elite = costs.argsort(stable=True)[: settings.elites]
            mean, spread = (
                drawn[elite].mean(0),
                drawn[elite].std(0, correction=0).clamp_min(settings.least),
            )
            if float(costs[elite[0]]) < lowest:
                best, lowest, self.foreseen = (
                    drawn[elite[0]],
                    float(costs[elite[0]]),
                    paths[elite[0]],
                )
        ahead = slice(settings.replan, None)
        self.mean = torch.cat([mean[ahead], mean[-1:].expand(settings.replan, -1)])
        self.spread = torch.cat(
            [spread[ahead], torch.full_like(spread[: settings.replan], settings.spread)]
        )
        return best


class Dreamer:
    """Imagination of a learned model, which remembers what its robot has done so far.

    Args:
        model: that predicts the novice.
        heights: (H, W), m, of the ground.
        pixels: P of the model's maps.
        horizon: control steps that are imagined from where the robot is.
    """

    def __init__(
        self, model: Predictor, heights: np.ndarray, pixels: int, horizon: int = 0
    ) -> None:
        self.model, self.pixels = model, pixels
        self.longest = STEPS - horizon  # of the memory
        self.heights = torch.as_tensor(heights, dtype=torch.float32)
        self.memory: Memory | None = None
        # states and actions that the memory is of, or will be
        self.done: list[tuple[Tensor, Tensor]] = []
        self.new = 0  # how many of them it does not have yet

    def imagine(self, state: np.ndarray | Tensor, actions: Tensor) -> Tensor:
        """Where `actions` (N, H, 2) lead from `state` (13,): states (N, H + 1, 13) float64."""
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
        """Note that the robot was in `state` (13,) and did `action` (2,)."""
        self.done.append(
            (
                torch.as_tensor(state, dtype=torch.float32),
                torch.as_tensor(action, dtype=torch.float32),
            )
        )
        self.new += 1

    def remember(self) -> None:
        """Take into the memory what was observed since the last time.

        What is remembered and imagined together is never longer than STEPS, the most
        that training has seen: before it would be, the memory is made anew of half as
        many.
        """
        if len(self.done) > self.longest:
            self.done, self.memory = self.done[-self.longest // 2 :], None
            self.new = len(self.done)
        if self.new:
            states, actions = (
                torch.stack(some)[None]
                for some in zip(*self.done[-self.new :], strict=True)
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


def heading_to(state: np.ndarray, goal: np.ndarray) -> float:
    """From the robot's heading to the direction of a goal (2,), rad, in [-pi, pi]; positive to the left."""
    x, y = np.asarray(goal) - np.asarray(state)[POSITION][:2]
    yaw = rotations.yaw(torch.as_tensor(state)[QUATERNION])
    return float(rotations.wrap(torch.atan2(torch.tensor(y), torch.tensor(x)) - yaw))


def straight(state: np.ndarray, goal: np.ndarray) -> np.ndarray:
    """The action (2,) of a driver who looks at nothing but the goal: constant throttle, steering towards it."""
    # positive steering turns right
    return np.array([FASTEST, np.clip(-1.5 * heading_to(state, goal), -1, 1)])
