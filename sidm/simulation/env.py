"""The robot as a Gymnasium environment, for planning and reinforcement learning.

It needs gymnasium besides PyBullet. Importing this module registers ``sidm/Rover-v0``::

    env = gymnasium.make(
        "sidm.simulation.env:sidm/Rover-v0", system="system2", role="novice"
    )

The environment gives no reward, because it has no goal. A wrapper adds a goal and a
reward; :class:`ReachPoint` is such a wrapper.
"""

from __future__ import annotations

import copy
from typing import Any, Final

import numpy as np
from scipy.spatial.transform import Rotation

try:
    import gymnasium
except ImportError as error:  # pragma: no cover
    raise ImportError(
        "the environment needs Gymnasium: pip install gymnasium "
        "(all else works without it)"
    ) from error
from gymnasium import spaces

from sidm.body import ROVER
from sidm.drives import ACTION_SIZE, POSITION, QUATERNION, STEPS, TWIST
from sidm.simulation.collecting import EpisodeRules
from sidm.simulation.simulator import Simulator
from sidm.systems import System, find_system
from sidm.terrain import generate_terrain, height_at

#: numbers of the paper's x beside the map: up direction 3, twist 6, action 2
INPUT_SIZE: Final = len(ROVER.inputs)
MAP_SIZE: Final = ROVER.map_size  # m, side of the robot-centred map

Observation = dict[str, np.ndarray]


class Rover(gymnasium.Env):
    """A robot of the paper on random ground.

    An action is (throttle, steering), (2,), each in [-1, 1], applied for a control step
    of 0.1 s. The reward is 0. An observation is a dict with the x of section 4:
    ``motion`` (11,) has the up direction in the body frame, the twist (m/s, rad/s) and
    the last action (zeros after `reset`); ``map`` (P, P) has the heights of the ground
    around the robot, m, relative to the robot's height and turned with its heading.

    An episode ends by the rules for collected trajectories. A step terminates the
    episode when the robot is stuck or rolled over or the simulation failed, and
    truncates it at the terrain's border; ``info["ended"]`` names the cause.
    ``info["state"]`` is the absolute state (13,). If the simulation failed, the
    previous observation is returned again.

    `reset` takes ``options``: ``terrain_seed`` (int), ``heights`` (H, W), m, and
    ``start`` (x, y, yaw), m and rad. Ground and heading that are not given are drawn at
    random.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 10}

    def __init__(
        self,
        system: str | System = "system1",
        role: str = "novice",
        pixels: int = 64,
        render_mode: str | None = None,
    ) -> None:
        """Choose the robot: a pair or its name, and 'novice' or 'expert'.

        `pixels` are along a side of the observed map; `render_mode` is 'rgb_array' for
        pictures, or None.
        """
        if pixels < 1:
            raise ValueError(f"pixels must be 1 or more, not {pixels}")
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise ValueError(f"render_mode is None or 'rgb_array', not {render_mode!r}")
        self.system = find_system(system) if isinstance(system, str) else system
        self.pixels, self.render_mode = pixels, render_mode
        self.robot = self.system.robot(role)
        self.action_space = spaces.Box(-1.0, 1.0, (ACTION_SIZE,), np.float32)
        motion = spaces.Box(-np.inf, np.inf, (INPUT_SIZE,), np.float32)
        ground = spaces.Box(-np.inf, np.inf, (pixels, pixels), np.float32)
        self.observation_space = spaces.Dict({"motion": motion, "map": ground})
        self._simulator: Simulator | None = None

    @property
    def simulator(self) -> Simulator:
        """The simulator of the present episode; ResetNeeded before the first one."""
        if self._simulator is None:
            raise gymnasium.error.ResetNeeded("reset the environment before using it")
        return self._simulator

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Drop the robot on new ground; `options` as the class says."""
        super().reset(seed=seed)
        options = dict(options or {})
        terrain_seed = int(options.pop("terrain_seed", self.np_random.integers(2**62)))
        heights = options.pop("heights", None)
        heading = self.np_random.uniform(-np.pi, np.pi)
        x, y, yaw = options.pop("start", (0.0, 0.0, heading))
        if options:
            raise ValueError(
                f"unknown option {sorted(options)[0]!r}; "
                "known: terrain_seed, heights, start"
            )
        if heights is None:
            heights = generate_terrain(self.system.terrain, terrain_seed)
        heights = np.asarray(heights, float)
        simulator, visible = self._simulator, self.render_mode is not None
        if simulator and not visible and heights.shape == simulator.heights.shape:
            simulator.set_terrain(heights)
        else:  # a new simulator only if needed
            self.close()
            physics = self.system.physics
            self._simulator = Simulator(self.robot, heights, physics, visible=visible)
        state = self.simulator.reset(x, y, yaw)
        rows, columns = self.simulator.heights.shape
        reach = np.array([columns - 1, rows - 1]) * self.system.terrain.spacing / 2
        self._rules = EpisodeRules(state, reach)
        self._observation = self._observe(state, np.zeros(ACTION_SIZE))
        return copy.deepcopy(self._observation), {"state": state, "ended": None}

    def step(
        self, action: np.ndarray
    ) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Drive for 0.1 s by an action (throttle, steering), (2,); the reward is 0."""
        state = self.simulator.step(action)
        cause = self._rules.ended(state)
        terminated, truncated = cause not in (None, "border"), cause == "border"
        if np.isfinite(state).all():
            self._observation = self._observe(state, action)
        observation = copy.deepcopy(self._observation)
        return observation, 0.0, terminated, truncated, {"state": state, "ended": cause}

    def render(self) -> np.ndarray | None:
        """A picture (480, 640, 3), uint8, of the robot; None without a render mode."""
        return self.simulator.picture() if self.render_mode else None

    def close(self) -> None:
        """Free the simulation; `reset` begins a new one."""
        if self._simulator is not None:
            self._simulator.close()
            self._simulator = None

    def _observe(self, state: np.ndarray, action: np.ndarray) -> Observation:
        """The observation of a state (13,) after an action (2,).

        Axes of the map are those of `sidm.learning.robot_centred_map`.
        """
        up = _attitude(state)[2]
        motion = np.concatenate([up, state[TWIST], np.clip(action, -1, 1)])
        offsets = ((np.arange(self.pixels) + 0.5) / self.pixels - 0.5) * MAP_SIZE
        forward, left = offsets[None, :], offsets[:, None]
        cos, sin = _heading(state)
        x, y, z = state[POSITION]
        ground = height_at(
            self.simulator.heights,
            x + cos * forward - sin * left,
            y + sin * forward + cos * left,
        )
        seen = {"motion": motion, "map": ground - z}
        return {name: values.astype(np.float32) for name, values in seen.items()}


class ReachPoint(gymnasium.Wrapper):
    """A goal for the rover: to reach a random point on a ring around the start.

    The observation gets an entry ``goal`` (2,): the point's distance ahead of the robot
    and to its left, m. The reward of a step is by how much it brought the robot nearer
    to the point, m, and 1 more when the robot reaches it, which ends the episode.
    """

    def __init__(
        self,
        env: gymnasium.Env,
        nearest: float = 3.0,
        farthest: float = 8.0,
        radius: float = 0.5,
    ) -> None:
        """Wrap a `Rover`; goals are `nearest` to `farthest` from the start, m.

        A robot that is nearer to the goal than `radius`, m, has reached it.
        """
        super().__init__(env)
        if not radius < nearest <= farthest:
            raise ValueError(
                "radius < nearest <= farthest must hold, "
                f"not {radius}, {nearest}, {farthest}"
            )
        self.nearest, self.farthest, self.radius = nearest, farthest, radius
        goal = spaces.Box(-np.inf, np.inf, (2,), np.float32)
        assert isinstance(env.observation_space, spaces.Dict)
        entries = env.observation_space.spaces
        self.observation_space = spaces.Dict({**entries, "goal": goal})

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin an episode and draw its goal, whose place (2,), m, the info has."""
        observation, info = self.env.reset(seed=seed, options=options)
        rng = self.env.unwrapped.np_random
        self._distance = rng.uniform(self.nearest, self.farthest)
        bearing = rng.uniform(-np.pi, np.pi)
        direction = np.array([np.cos(bearing), np.sin(bearing)])
        self._state = info["state"]
        self.goal = self._state[POSITION][:2] + self._distance * direction
        return self._with_goal(observation), info | {"goal": self.goal.copy()}

    def step(
        self, action: np.ndarray
    ) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Drive for 0.1 s by an action (throttle, steering), (2,)."""
        observation, reward, terminated, truncated, info = self.env.step(action)
        # if the simulation failed, the robot keeps its last position
        if np.isfinite(info["state"]).all():
            self._state = info["state"]
        distance = float(np.linalg.norm(self.goal - self._state[POSITION][:2]))
        gained, self._distance = self._distance - distance, distance
        reached = distance < self.radius
        reward = float(reward) + gained + float(reached)
        info |= {"goal": self.goal.copy(), "reached": reached}
        observation = self._with_goal(observation)
        return observation, reward, terminated or reached, truncated, info

    def _with_goal(self, observation: Observation) -> Observation:
        cos, sin = _heading(self._state)
        east, north = self.goal - self._state[POSITION][:2]
        ahead, left = cos * east + sin * north, cos * north - sin * east
        return {**observation, "goal": np.array([ahead, left], np.float32)}


def _attitude(state: np.ndarray) -> np.ndarray:
    """The rotation matrix (3, 3) from the body frame to the world."""
    return Rotation.from_quat(state[QUATERNION]).as_matrix()


def _heading(state: np.ndarray) -> np.ndarray:
    """Cosine and sine (2,) of the yaw."""
    ahead = _attitude(state)[:2, 0]
    return ahead / np.linalg.norm(ahead)


gymnasium.register(
    "sidm/Rover-v0", entry_point=f"{__name__}:Rover", max_episode_steps=STEPS
)
