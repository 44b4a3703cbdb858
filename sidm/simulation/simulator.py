"""The simulator of one robot on one terrain in Bullet."""

from __future__ import annotations

import contextlib
import tempfile
from typing import Any

import numpy as np

from sidm.simulation.client import Client
from sidm.simulation.dimensions import AXLES
from sidm.simulation.ground import HeightField
from sidm.simulation.rendering import DrawnRods
from sidm.simulation.robot import HEAVES, KINGPINS, ROLLS, WHEELS, urdf
from sidm.simulation.suspension import Suspension
from sidm.systems import Physics, Robot
from sidm.terrain import height_at

RELEASED = Physics()  # the constants of the released simulator
START_RADIUS = 1.0  # m, the robot is dropped above the highest ground within it


class Simulator(contextlib.AbstractContextManager):
    """A robot on a terrain, stepped at 10 Hz; a context manager.

    Args:
        robot: the robot's parameters.
        heights: (H, W), m, index [y, x], 0.1 m apart, centred on the origin.
        physics: constants of the simulation.
        visible: whether pictures show the ground, which takes longer to build then.
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
        self._build(heights)

    def __exit__(self, *_: Any) -> None:
        self.close()

    def close(self) -> None:
        """Free the simulation; further calls fail."""
        self._client.close()

    def _restart(self) -> None:
        """Go back to the moment after building."""
        # numbers that are not finite would outlast a restored state
        if np.isfinite(self.state).all():
            self._client.restoreState(self._pristine)
        else:
            self.close()
            self._build(self.heights)

    @property
    def heights(self) -> np.ndarray:
        """The terrain (H, W), m, float64."""
        return self._ground.heights

    def _build(self, heights: np.ndarray) -> None:
        self._client, physics = Client(), self.physics
        client = self._client
        client.setGravity(0, 0, -physics.gravity)
        client.setPhysicsEngineParameter(
            fixedTimeStep=physics.time_step,
            numSolverIterations=physics.solver_iterations,
            solverResidualThreshold=physics.solver_residual,
            contactBreakingThreshold=physics.contact_threshold,
            contactSlop=physics.contact_slop,
            deterministicOverlappingPairs=1,
        )
        self._ground = HeightField(client, heights, physics, self._visible)
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
        pairs = zip(HEAVES, ROLLS, strict=True)
        self._axles = [joints[name] for pair in pairs for name in pair]
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
        heaves = zip(self._axles[::2], self._suspensions.values(), strict=True)
        for joint, suspension in heaves:
            if suspension.heave_free:
                angle = suspension.joints.heave_angle(start)
                client.resetJointState(self._body, joint, angle)
        if self._visible:
            # in Bullet a joint and the link that it moves have the same number
            axles = dict(zip(AXLES, self._axles[1::2], strict=True))
            self._rods = DrawnRods(client, self._body, axles, self._suspensions)
        self._pristine = client.saveState()

    def set_terrain(self, heights: np.ndarray) -> None:
        """Replace the terrain by heights (H, W), m, of one shape; call `reset` next.

        It takes a third of the time of building a new Simulator. The motion that
        follows is that of a new Simulator, bit for bit.
        """
        self._restart()
        self._ground.replace(heights)
        self._client.removeState(self._pristine)
        self._pristine = self._client.saveState()

    def reset(self, x: float = 0.0, y: float = 0.0, yaw: float = 0.0) -> np.ndarray:
        """Drop the robot on the ground at x and y, m; the state (13,) after settling.

        Its heading is `yaw`, rad. All history is erased: the result is that of a new
        Simulator, bit for bit.
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
        """The state (13,) after a control step with an action (throttle, steering).

        Both are clipped to [-1, 1].
        """
        action = np.asarray(action, float)
        if action.shape != (2,) or not np.isfinite(action).all():
            raise ValueError(
                "an action is 2 finite numbers, shape (2,), "
                f"not {action} of shape {action.shape}"
            )
        self._drive(np.clip(action, -1, 1))
        self._simulate(self.physics.steps_per_control)
        return self.state

    def _drive(self, action: np.ndarray) -> None:
        """Set the targets of wheels and kingpins, which hold until the next call."""
        client, robot, physics = self._client, self.robot, self.physics
        throttle = action[0] * robot.throttle_scale
        stop = physics.kingpin_stop
        steering = np.clip(action[1] * robot.steering_scale, -stop, stop)
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
        """Advance by physics steps, with the suspensions' torques in each of them."""
        client, body, joints = self._client, self._body, self._axles
        # looked up once, because a client looks up and wraps a function each time
        get_joints, apply = client.getJointStates, client.setJointMotorControlArray
        advance, torque = client.stepSimulation, client.TORQUE_CONTROL
        rear, front = (self._suspensions[axle].torques for axle in AXLES)
        for _ in range(steps):
            # angles and speeds of the rear heave and roll, then of the front ones
            states = get_joints(body, joints)
            (h0, v0, *_), (r0, w0, *_), (h1, v1, *_), (r1, w1, *_) = states
            torques = [*rear(h0, v0, r0, w0), *front(h1, v1, r1, w1)]
            apply(body, joints, torque, forces=torques)
            advance()

    @property
    def state(self) -> np.ndarray:
        """The state (13,), float64; the table in `sidm.drives` lists its entries."""
        client = self._client
        position, quaternion = client.getBasePositionAndOrientation(self._body)
        matrix = np.array(client.getMatrixFromQuaternion(quaternion)).reshape(3, 3)
        velocities = client.getBaseVelocity(self._body)  # linear and angular, world
        twist = [matrix.T @ np.array(velocity) for velocity in velocities]
        return np.concatenate([position, quaternion, *twist])

    @property
    def strut_positions(self) -> np.ndarray:
        """Travel of the struts (4,), m, compression positive.

        The order is rear right, rear left, front right, front left.
        """
        heaves = self._client.getJointStates(self._body, self._axles[::2])
        pairs = zip(self._suspensions.values(), heaves, strict=True)
        travels = [suspension.travel(heave[0]) for suspension, heave in pairs]
        return np.concatenate(travels)

    @property
    def joint_angles(self) -> np.ndarray:
        """Angles (10,), rad, of the joints in `sidm.simulation.robot.urdf`.

        The order is heave and roll of the rear axle, heave and roll of the front axle,
        the four wheels in the order of the struts, right kingpin, left kingpin.
        """
        joints = [*self._axles, *self._wheels, *self._kingpins]
        states = self._client.getJointStates(self._body, joints)
        return np.array([joint[0] for joint in states])

    def picture(
        self,
        width: int = 640,
        height: int = 480,
        distance: float = 1.6,
        yaw: float = 40.0,
        pitch: float = -25.0,
    ) -> np.ndarray:
        """A picture (height, width, 3), uint8, drawn by Bullet's software renderer.

        The ground appears only in a simulator made with `visible=True`. The camera is
        at a `distance`, m, from the body; its yaw about the vertical and its pitch,
        negative from above, are in degrees.
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
        """A token for `restore`; it takes memory until `forget` is called with it."""
        slips = [suspension.slip for suspension in self._suspensions.values()]
        return self._client.saveState(), slips

    def restore(self, token: tuple[int, list[float]]) -> np.ndarray:
        """Go back to the moment of a token; returns its state (13,).

        RuntimeError after a step whose state is not finite: that would outlast the
        restored state. `reset` builds the simulation anew, without its tokens.
        """
        if not np.isfinite(self.state).all():
            raise RuntimeError("the simulated state is not finite; call reset")
        state, slips = token
        self._client.restoreState(state)
        for suspension, slip in zip(self._suspensions.values(), slips, strict=True):
            suspension.slip = slip
        return self.state

    def forget(self, token: tuple[int, list[float]]) -> None:
        """Free the memory of a token, which cannot be restored afterwards."""
        self._client.removeState(token[0])
