"""The robot as a Gymnasium environment, for planning and reinforcement learning; needs gymnasium besides PyBullet.

Importing this module registers ``sidm/Rover-v0``::

    env = gymnasium.make("sidm.simulation.env:sidm/Rover-v0", system="system2",
    role="novice")

The environment gives no reward: what is worth reaching is a wrapper's to say, and
:class:`ReachPoint` is one.
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
        "the environment needs Gymnasium: pip install gymnasium (all else works without it)"
    ) from error
from gymnasium import spaces

from sidm.body import ROVER
from sidm.drives import ACTION_SIZE, POSITION, QUATERNION, STEPS, TWIST
from sidm.simulation.collecting import EpisodeRules
from sidm.simulation.simulator import Simulator
from sidm.systems import System, find_system
from sidm.terrain import generate_terrain, height_at

#: up direction 3, twist 6, action 2: the paper's x
INPUT_SIZE: Final = len(ROVER.inputs)
MAP_SIZE: Final = ROVER.map_size  # side of the robot-centred map, m


class Rover(gymnasium.Env):
    """A robot of the paper on random ground; an episode ends as a collected trajectory does.

    Action: (throttle, steering), (2,), each in [-1, 1], held for a control step of 0.1
    s. Observation: a dict of ``motion`` (11,), up direction in the body frame, twist
    (m/s, rad/s) and the action that led here (zeros after reset), and ``map`` (P, P),
    m, the ground around the robot, turned with its heading, less its height: together
    the x of section 4. Reward: 0.

    A step terminates the episode when the robot is stuck, rolled over or the simulation
    failed, and truncates it at the terrain's border; ``info["ended"]`` names the cause.
    ``info["state"]`` is the absolute state (13,). A simulation that failed has no place
    on the map: its step repeats the observation before it.

    `reset` takes ``options``: ``terrain_seed`` (int), ``heights`` (H, W), m, and
    ``start`` (x, y, yaw), m and rad; ground and heading are drawn where they are not
    given.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 10}

    def __init__(
        self,
        system: str | System = "system1",
        role: str = "novice",
        pixels: int = 64,
        render_mode: str | None = None,
    ) -> None:
        """Take `role` of `system`, a name or a pair of your own, maps of `pixels` a side, 'rgb_array' for pictures.

        Raises:
            ValueError: no pixels, or another `render_mode`.
        """
        if pixels < 1:
            raise ValueError(f"pixels must be 1 or more, not {pixels}")
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise ValueError(f"render_mode is None or 'rgb_array', not {render_mode!r}")
        self.system = find_system(system) if isinstance(system, str) else system
        self.pixels, self.render_mode = pixels, render_mode
        self.robot = self.system.robot(role)
        self.action_space = spaces.Box(-1.0, 1.0, (ACTION_SIZE,), np.float32)
        self.observation_space = spaces.Dict(
            {
                "motion": spaces.Box(-np.inf, np.inf, (INPUT_SIZE,), np.float32),
                "map": spaces.Box(-np.inf, np.inf, (pixels, pixels), np.float32),
            }
        )
        self._simulator: Simulator | None = None

    @property
    def simulator(self) -> Simulator:
        """The simulator of the present episode; ResetNeeded before the first."""
        if self._simulator is None:
            raise gymnasium.error.ResetNeeded("reset the environment before using it")
        return self._simulator

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
        """Drop the robot on new ground: observation and info, its state (13,); ValueError for an unknown option."""
        super().reset(seed=seed)
        options = dict(options or {})
        terrain_seed = int(options.pop("terrain_seed", self.np_random.integers(2**62)))
        heights = options.pop("heights", None)
        x, y, yaw = options.pop(
            "start", (0.0, 0.0, self.np_random.uniform(-np.pi, np.pi))
        )
        if options:
            raise ValueError(
                f"unknown option {sorted(options)[0]!r}; known: terrain_seed, heights, start"
            )
        heights = (
            generate_terrain(self.system.terrain, terrain_seed)
            if heights is None
            else heights
        )
        self._begin(np.asarray(heights, float))
        state = self.simulator.reset(x, y, yaw)
        half_width = (
            (min(self.simulator.heights.shape) - 1) * self.system.terrain.spacing / 2
        )
        self._rules = EpisodeRules(state, half_width)
        self._seen = self._observe(state, np.zeros(ACTION_SIZE))
        return copy.deepcopy(self._seen), {"state": state, "ended": None}

    def _begin(self, heights: np.ndarray) -> None:
        """Put the robot on a terrain (H, W), m, in the simulator at hand if that can be."""
        if (
            self._simulator is not None
            and not self.render_mode
            and heights.shape == self._simulator.heights.shape
        ):
            self._simulator.put_on(heights)
            return
        self.close()
        self._simulator = Simulator(
            self.robot,
            heights,
            self.system.physics,
            visible=self.render_mode is not None,
        )

    def step(
        self, action: np.ndarray
    ) -> tuple[dict[str, np.ndarray], float, bool, bool, dict[str, Any]]:
        """Drive for 0.1 s by (throttle, steering), (2,): observation, reward 0, terminated, truncated, info."""
        state = self.simulator.step(action)
        cause = self._rules.ended(state)
        ended, outside = cause not in (None, "border"), cause == "border"
        if np.isfinite(state).all():
            self._seen = self._observe(state, action)
        return (
            copy.deepcopy(self._seen),
            0.0,
            ended,
            outside,
            {"state": state, "ended": cause},
        )

    def render(self) -> np.ndarray | None:
        """The robot from a camera that follows it, (480, 640, 3) uint8; None without a render mode."""
        return self.simulator.picture() if self.render_mode else None

    def close(self) -> None:
        """Free the simulation; `reset` begins another."""
        if self._simulator is not None:
            self._simulator.close()
            self._simulator = None

    def _observe(self, state: np.ndarray, action: np.ndarray) -> dict[str, np.ndarray]:
        motion = np.concatenate(
            [_attitude(state)[2], state[TWIST], np.clip(action, -1, 1)]
        )
        return {"motion": motion.astype(np.float32), "map": self._map(state)}

    def _map(self, state: np.ndarray) -> np.ndarray:
        """Axis 0 runs along the body's y, axis 1 along its x, as `robot_centred_map` of sidm.learning has it."""
        offsets = ((np.arange(self.pixels) + 0.5) / self.pixels - 0.5) * MAP_SIZE
        forward, left = offsets[None, :], offsets[:, None]
        cos, sin = _heading(state)
        x, y, z = state[POSITION]
        ground = height_at(
            self.simulator.heights,
            x + cos * forward - sin * left,
            y + sin * forward + cos * left,
        )
        return (ground - z).astype(np.float32)


class ReachPoint(gymnasium.Wrapper):
    """A goal for the rover: come within `radius` of a point drawn on a ring around the start.

    Adds ``goal`` (2,), m, the point's place ahead and to the left of the robot, to the
    observation. The reward is the metres by which a step came nearer to it, and 1 more
    for reaching it, which ends the episode.
    """

    def __init__(
        self,
        env: gymnasium.Env,
        nearest: float = 3.0,
        farthest: float = 8.0,
        radius: float = 0.5,
    ) -> None:
        """Draw goals between `nearest` and `farthest` from the start, m; ValueError for distances in another order."""
        super().__init__(env)
        if not radius < nearest <= farthest:
            raise ValueError(
                f"radius < nearest <= farthest must hold, not {radius}, {nearest}, {farthest}"
            )
        self.nearest, self.farthest, self.radius = nearest, farthest, radius
        goal = spaces.Box(-np.inf, np.inf, (2,), np.float32)
        assert isinstance(env.observation_space, spaces.Dict)
        self.observation_space = spaces.Dict(
            {**env.observation_space.spaces, "goal": goal}
        )

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
        """Begin an episode and draw its goal; ``info["goal"]`` is its place (2,) in the world, m."""
        observation, info = self.env.reset(seed=seed, options=options)
        rng = self.env.unwrapped.np_random
        distance, bearing = (
            rng.uniform(self.nearest, self.farthest),
            rng.uniform(-np.pi, np.pi),
        )
        self._state = info["state"]
        self.goal = self._state[POSITION][:2] + distance * np.array(
            [np.cos(bearing), np.sin(bearing)]
        )
        self._distance = distance
        return self._with_goal(observation), info | {"goal": self.goal.copy()}

    def step(
        self, action: np.ndarray
    ) -> tuple[dict[str, np.ndarray], float, bool, bool, dict[str, Any]]:
        """Drive for 0.1 s by (throttle, steering), (2,), rewarded by the metres gained."""
        observation, reward, terminated, truncated, info = self.env.step(action)
        # else the simulation failed, and the robot stays where it was
        if np.isfinite(info["state"]).all():
            self._state = info["state"]
        distance = float(np.linalg.norm(self.goal - self._state[POSITION][:2]))
        gained, self._distance = self._distance - distance, distance
        reached = distance < self.radius
        observation = self._with_goal(observation)
        info |= {"goal": self.goal.copy(), "reached": reached}
        return (
            observation,
            float(reward) + gained + float(reached),
            terminated or reached,
            truncated,
            info,
        )

    def _with_goal(self, observation: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        cos, sin = _heading(self._state)
        east, north = self.goal - self._state[POSITION][:2]
        goal = np.array(
            [cos * east + sin * north, cos * north - sin * east], np.float32
        )
        return {**observation, "goal": goal}


def _attitude(state: np.ndarray) -> np.ndarray:
    """The matrix (3, 3) that turns body vectors into the world."""
    return Rotation.from_quat(state[QUATERNION]).as_matrix()


def _heading(state: np.ndarray) -> np.ndarray:
    """Cosine and sine of the yaw."""
    ahead = _attitude(state)[:2, 0]
    return ahead / np.linalg.norm(ahead)


gymnasium.register(
    "sidm/Rover-v0", entry_point=f"{__name__}:Rover", max_episode_steps=STEPS
)
