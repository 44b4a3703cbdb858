"""One robot on one terrain in Bullet: reset, step, strut positions, save and restore."""

from __future__ import annotations

import tempfile
from typing import Any

import numpy as np

from sidm.simulation.client import Client
from sidm.simulation.dimensions import AXLES
from sidm.simulation.ground import Ground
from sidm.simulation.rendering import DrawnRods
from sidm.simulation.robot import HEAVES, KINGPINS, ROLLS, WHEELS, urdf
from sidm.simulation.suspension import Suspension
from sidm.systems import Physics, Robot
from sidm.terrain import height_at

RELEASED = Physics()  # the constants of the released simulator
START_RADIUS = 1.0  # m: the start is dropped above the highest ground this near


class Simulator:
    """A robot on a terrain, stepped at 10 Hz; a context manager.

    Args:
        robot: the robot's parameters.
        heights: (H, W), m, index [y, x], 0.1 m apart, centred on the origin.
        physics: constants of the simulation.
        visible: build the ground so that pictures show it, which takes longer.
    """

    def __init__(
        self,
        robot: Robot,
        heights: np.ndarray,
        physics: Physics = RELEASED,
        *,
        visible: bool = False,
    ) -> None:
        """Build the terrain and the robot; nothing is simulated before `reset`."""
        self.robot, self.physics, self._visible = robot, physics, visible
        self._suspensions = {axle: Suspension(robot, axle, physics) for axle in AXLES}
        self._start(heights)

    def __enter__(self) -> Simulator:
        """The simulator itself."""
        return self

    def __exit__(self, *_: Any) -> None:
        """Close the connection to Bullet."""
        self.close()

    def close(self) -> None:
        """Free the simulation; further calls fail."""
        self._client.close()

    def _start(self, heights: np.ndarray) -> None:
        self._client = Client()
        try:
            self._build(heights)
        except Exception:
            self.close()
            raise
        self._pristine = self._client.saveState()

    def _restart(self) -> None:
        """Back to the moment after building; not finite numbers would stay: then in a new Bullet."""
        if np.isfinite(self.state).all():
            self._client.restoreState(self._pristine)
        else:
            self.close()
            self._start(self.heights)

    @property
    def heights(self) -> np.ndarray:
        """The terrain (H, W), m, float64."""
        return self._ground.heights

    def _build(self, heights: np.ndarray) -> None:
        client, physics = self._client, self.physics
        client.setGravity(0, 0, -physics.gravity)
        client.setPhysicsEngineParameter(
            fixedTimeStep=physics.time_step,
            numSolverIterations=physics.solver_iterations,
            solverResidualThreshold=physics.solver_residual,
            contactBreakingThreshold=physics.contact_threshold,
            contactSlop=physics.contact_slop,
            deterministicOverlappingPairs=1,
        )
        self._ground = Ground(client, heights, physics, self._visible)
        with tempfile.NamedTemporaryFile("w", suffix=".urdf") as file:
            file.write(urdf(self.robot, self._suspensions))
            file.flush()
            self._body = client.loadURDF(
                file.name, flags=client.URDF_USE_INERTIA_FROM_FILE
            )
        joints = {
            client.getJointInfo(self._body, j)[1].decode(): j
            for j in range(client.getNumJoints(self._body))
        }
        self._axles = [
            joints[name] for pair in zip(HEAVES, ROLLS, strict=True) for name in pair
        ]
        self._wheels = [joints[name] for name in WHEELS]
        self._kingpins = [joints[name] for name in KINGPINS]
        for link in range(-1, len(joints)):
            client.changeDynamics(
                self._body,
                link,
                linearDamping=physics.damping,
                angularDamping=physics.damping,
                restitution=0.0,
                lateralFriction=self.robot.friction,
            )
        client.setJointMotorControlArray(
            self._body, self._axles, client.VELOCITY_CONTROL, forces=[0.0] * 4
        )
        start = min(max(0.0, self.robot.travel_lower), self.robot.travel_upper)
        for joint, suspension in zip(
            self._axles[::2], self._suspensions.values(), strict=True
        ):
            if suspension.heave_free:
                client.resetJointState(
                    self._body, joint, suspension.joints.heave_angle(start)
                )
        if self._visible:
            # a joint's number is that of the link it moves
            axles = dict(zip(AXLES, self._axles[1::2], strict=True))
            self._rods = DrawnRods(client, self._body, axles, self._suspensions)

    def put_on(self, heights: np.ndarray) -> None:
        """Exchange the terrain for `heights` (H, W), m, of the same shape; it takes a third of the time of building.

        What follows is that of a new Simulator, bit for bit; `reset` comes first.

        Raises:
            ValueError: another shape, not finite or too high; or the simulator is
                visible.
        """
        self._restart()
        self._ground.exchange(heights)
        self._client.removeState(self._pristine)
        self._pristine = self._client.saveState()

    def reset(self, x: float = 0.0, y: float = 0.0, yaw: float = 0.0) -> np.ndarray:
        """Drop the robot at (x, y), m, heading `yaw`, rad; its state (13,) after it has settled.

        All history is erased: the result is that of a new Simulator, bit for bit.
        """
        self._restart()
        client, physics = self._client, self.physics
        for suspension in self._suspensions.values():
            suspension.slip = 0.0
        reach = np.linspace(-START_RADIUS, START_RADIUS, 41)
        dx, dy = np.meshgrid(reach, reach)
        near = np.hypot(dx, dy) <= START_RADIUS
        top = height_at(self.heights, x + dx[near], y + dy[near]).max()
        turn = [0.0, 0.0, np.sin(yaw / 2), np.cos(yaw / 2)]
        client.resetBasePositionAndOrientation(
            self._body, [x, y, top + physics.drop_height], turn
        )
        self._drive(np.zeros(2))
        self._simulate(round(physics.settling_time / physics.time_step))
        return self.state

    def step(self, action: np.ndarray) -> np.ndarray:
        """Apply an action (throttle, steering), clipped to [-1, 1], for one control step; the state (13,) after it.

        Raises:
            ValueError: the action is not two finite numbers.
        """
        action = np.asarray(action, float)
        if action.shape != (2,) or not np.isfinite(action).all():
            raise ValueError(
                f"an action is 2 finite numbers, shape (2,), not {action} of shape {action.shape}"
            )
        self._drive(np.clip(action, -1, 1))
        self._simulate(self.physics.steps_per_control)
        return self.state

    def _drive(self, action: np.ndarray) -> None:
        """Set the targets of wheels and kingpins, which hold until the next call."""
        client, robot, physics = self._client, self.robot, self.physics
        throttle = action[0] * robot.throttle_scale
        steering = np.clip(
            action[1] * robot.steering_scale,
            -physics.kingpin_stop,
            physics.kingpin_stop,
        )
        client.setJointMotorControlArray(
            self._body,
            self._wheels,
            client.VELOCITY_CONTROL,
            targetVelocities=[throttle] * 4,
            forces=[physics.wheel_torque] * 4,
        )
        for kingpin in self._kingpins:
            client.setJointMotorControl2(
                self._body,
                kingpin,
                client.POSITION_CONTROL,
                targetPosition=steering,
                maxVelocity=physics.steering_rate,
            )

    def _simulate(self, steps: int) -> None:
        """Advance by physics steps, with the suspension's torques in each."""
        client, body, joints = self._client, self._body, self._axles
        get, push, advance, torque_control = (
            client.getJointStates,
            client.setJointMotorControlArray,
            client.stepSimulation,
            client.TORQUE_CONTROL,
        )
        rear, front = (self._suspensions[axle].torques for axle in AXLES)
        for _ in range(steps):
            (h0, v0, *_), (r0, w0, *_), (h1, v1, *_), (r1, w1, *_) = get(body, joints)
            push(
                body,
                joints,
                torque_control,
                forces=[*rear(h0, v0, r0, w0), *front(h1, v1, r1, w1)],
            )
            advance()

    @property
    def state(self) -> np.ndarray:
        """The state (13,), float64, as `sidm.drives` tables it."""
        position, quaternion = self._client.getBasePositionAndOrientation(self._body)
        velocity = self._client.getBaseVelocity(self._body)
        world_to_body = (
            np.array(self._client.getMatrixFromQuaternion(quaternion)).reshape(3, 3).T
        )
        return np.concatenate(
            [position, quaternion, *(world_to_body @ np.array(v) for v in velocity)]
        )

    @property
    def strut_positions(self) -> np.ndarray:
        """Travel of the rear right, rear left, front right and front left strut (4,), m, compression positive."""
        angles = [
            joint[0]
            for joint in self._client.getJointStates(self._body, self._axles[::2])
        ]
        pairs = zip(self._suspensions.values(), angles, strict=True)
        return np.array(
            [
                travel
                for suspension, angle in pairs
                for travel in suspension.travel(angle)
            ]
        )

    @property
    def joint_angles(self) -> np.ndarray:
        """Angles (10,), rad, of heave and roll of the rear axle, of the front one, of the wheels and of the kingpins.

        Wheels are in the order of the struts, kingpins right then left; each turns as
        its joint in `robot.urdf` does.
        """
        joints = [*self._axles, *self._wheels, *self._kingpins]
        return np.array(
            [joint[0] for joint in self._client.getJointStates(self._body, joints)]
        )

    def ray_heights(self, points: np.ndarray) -> np.ndarray:
        """Heights (N,), m, where vertical rays at `points` (N, 2), m, meet the ground; NaN where they miss."""
        return self._ground.ray_heights(points)

    def picture(
        self,
        width: int = 640,
        height: int = 480,
        distance: float = 1.6,
        yaw: float = 40.0,
        pitch: float = -25.0,
    ) -> np.ndarray:
        """The robot where it stands, by Bullet's software renderer: (height, width, 3) uint8.

        Args:
            width: pixels.
            height: pixels.
            distance: of the camera from the body, m.
            yaw: of the camera about the vertical, degrees.
            pitch: of the camera, degrees, negative from above.

        The ground shows only in a simulator made with `visible=True`.
        """
        client = self._client
        if self._visible:
            self._rods.place()
        target = client.getBasePositionAndOrientation(self._body)[0]
        view = client.computeViewMatrixFromYawPitchRoll(
            target, distance, yaw, pitch, 0, 2
        )
        lens = client.computeProjectionMatrixFOV(45, width / height, 0.05, 60.0)
        pixels = client.getCameraImage(
            width,
            height,
            view,
            lens,
            lightDirection=[2, -4, 6],
            renderer=client.ER_TINY_RENDERER,
        )[2]
        return np.asarray(pixels, np.uint8).reshape(height, width, 4)[..., :3]

    def save(self) -> tuple[int, list[float]]:
        """A token for the present moment, to `restore` it later in this simulator; it takes memory until `forget`."""
        return self._client.saveState(), [
            suspension.slip for suspension in self._suspensions.values()
        ]

    def restore(self, token: tuple[int, list[float]]) -> np.ndarray:
        """Go back to the moment of `save`; its state (13,)."""
        state, slips = token
        self._client.restoreState(state)
        for suspension, slip in zip(self._suspensions.values(), slips, strict=True):
            suspension.slip = slip
        return self.state

    def forget(self, token: tuple[int, list[float]]) -> None:
        """Free what `save` keeps; the token serves no more."""
        self._client.removeState(token[0])
