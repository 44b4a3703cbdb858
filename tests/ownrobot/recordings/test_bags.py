"""ROS bags are written with the library and read back.

Poses, velocities and commands are read, and faults of a bag are named.
"""

import shutil
import sqlite3

import numpy as np
import pytest
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from ownrobot.body_file import read_body
from ownrobot.recordings import (
    RecordingError,
    RecordingWarning,
    guess_body,
    inspect_drives,
    read_drives,
)
from ownrobot.recordings.messages import ACKERMANN
from sidm.body import Body

BODY = Body(
    name="rover",
    pose="planar",
    columns=(("vx", "m/s"), ("yaw_rate", "rad/s")),
    actions=(("linear", "m/s"), ("angular", "rad/s")),
)


def header_of(store):
    """A header of either version of ROS."""
    kind = store.types["std_msgs/msg/Header"]
    stamp = store.types["builtin_interfaces/msg/Time"](sec=0, nanosec=0)
    number = {"seq": 0} if "seq" in kind.__annotations__ else {}
    return kind(**number, stamp=stamp, frame_id="odom")


def messages(store, turned: bool = False):
    """Messages (topic, time in s, message) of a robot on a circle of 2 m.

    With `turned`, the command does not contain the turning.
    """
    kind, header = store.types, header_of(store)
    vector, point = kind["geometry_msgs/msg/Vector3"], kind["geometry_msgs/msg/Point"]
    for step in range(81):
        time = 0.05 * step
        yaw, rate = 0.5 * time, 0.5 + 0.01 * np.sin(time)
        pose = kind["geometry_msgs/msg/Pose"](
            position=point(x=2 * np.sin(yaw), y=2 - 2 * np.cos(yaw), z=0.0),
            orientation=kind["geometry_msgs/msg/Quaternion"](
                x=0.0, y=0.0, z=np.sin(yaw / 2), w=np.cos(yaw / 2)
            ),
        )
        spare = np.zeros(36)
        twist = kind["geometry_msgs/msg/Twist"](
            linear=vector(
                x=(-1 if turned else 1) * (1 + 0.01 * np.sin(time)), y=0.0, z=0.0
            ),
            angular=vector(x=0.0, y=0.0, z=rate),
        )
        odometry = kind["nav_msgs/msg/Odometry"](
            header=header,
            child_frame_id="base",
            pose=kind["geometry_msgs/msg/PoseWithCovariance"](
                pose=pose, covariance=spare
            ),
            twist=kind["geometry_msgs/msg/TwistWithCovariance"](
                twist=twist, covariance=spare
            ),
        )
        yield "/odom", time, odometry
        command = kind["geometry_msgs/msg/Twist"](
            linear=vector(x=np.cos(time), y=0.0, z=0.0),
            angular=vector(x=0.0, y=0.0, z=np.sin(time)),
        )
        yield "/cmd_vel", time - 0.01, command


def joints(store, time: float):
    """A message of two wheels that turn faster and faster."""
    return store.types["sensor_msgs/msg/JointState"](
        header=header_of(store),
        name=["left-wheel", "right_wheel"],
        position=np.array([time**2, 2 * time**2]),
        velocity=np.array([2 * time, 4 * time]),
        effort=np.array([1 + time, 2 + time]),
    )


def ackermann(store, time: float, stamped: bool):
    """A command of a car whose speed and steering grow."""
    kinds = store.types
    drive = kinds["ackermann_msgs/msg/AckermannDrive"](
        steering_angle=0.1 * time,
        steering_angle_velocity=0.0,
        speed=1 + time,
        acceleration=0.0,
        jerk=0.0,
    )
    if not stamped:
        return drive
    kind = kinds["ackermann_msgs/msg/AckermannDriveStamped"]
    return kind(header=header_of(store), drive=drive)


def array(store, time: float, bits: int):
    """A command of two numbers."""
    kinds = store.types
    layout = kinds["std_msgs/msg/MultiArrayLayout"](dim=[], data_offset=0)
    kind = kinds[f"std_msgs/msg/Float{bits}MultiArray"]
    return kind(layout=layout, data=np.array([time, -time], f"float{bits}"))


#: Name of a further topic -> what makes its message at a time, s.
FURTHER = {
    "/joint_states": joints,
    "/drive": lambda store, time: ackermann(store, time, stamped=False),
    "/drive_stamped": lambda store, time: ackermann(store, time, stamped=True),
    "/wheels": lambda store, time: array(store, time, 64),
    "/motors": lambda store, time: array(store, time, 32),
}


@pytest.fixture
def make_bag(tmp_path):
    """Write a bag of ROS 1 or 2 with some topics.

    Odometry can be written twice, under another name. `without` says from when to when,
    s, a topic has no messages.
    """

    def make(
        ros: int = 2,
        topics=("/odom", "/cmd_vel"),
        twice: str = "",
        without: dict[str, tuple[float, float]] | None = None,
        **how,
    ):
        path = tmp_path / ("drive.bag" if ros == 1 else "drive")
        store = get_typestore(Stores.ROS1_NOETIC if ros == 1 else Stores.ROS2_HUMBLE)
        for name, definition in ACKERMANN.items():
            store.register(get_types_from_msg(definition, name))
        writer = Writer1(path) if ros == 1 else Writer2(path, version=9)
        write = store.serialize_ros1 if ros == 1 else store.serialize_cdr
        together = list(messages(store, **how))
        for name in topics:
            if name in FURTHER:
                times = [time for topic, time, _ in together if topic == "/odom"]
                together += [(name, t, FURTHER[name](store, t)) for t in times]
        together += [(twice, t, m) for topic, t, m in together if topic == "/odom"]
        with writer:
            connections = {}
            for topic, time, message in sorted(together, key=lambda one: one[1]):
                start, end = (without or {}).get(topic, (99, 99))
                if topic not in (*topics, twice) or not topic or start < time < end:
                    continue
                kind = message.__msgtype__
                if topic not in connections:
                    connections[topic] = writer.add_connection(
                        topic, kind, typestore=store
                    )
                writer.write(
                    connections[topic], int((10 + time) * 1e9), write(message, kind)
                )
        return path

    return make


@pytest.mark.parametrize("ros", [1, 2])
def test_a_bag_is_read_as_a_drive(make_bag, ros):
    (drive,) = read_drives(make_bag(ros), BODY)
    assert drive.states.shape[1] == 5 and 38 <= len(drive.actions) <= 40
    time = np.arange(len(drive.states)) / 10
    assert np.allclose(np.diff(drive.states[:, 2]), 0.05, atol=1e-6)
    assert np.allclose(np.hypot(*(drive.states[:, :2] - [0, 2]).T), 2, atol=1e-3)
    assert np.allclose(drive.actions[:, 0], np.cos(time[:-1]), atol=0.15)


@pytest.mark.parametrize(
    "how, words",
    [
        ({"topics": ("/odom",)}, "no topic with a command (geometry_msgs/msg/Twist"),
        ({"topics": ("/cmd_vel",)}, "no topic with a pose"),
        (
            {"twice": "/other"},
            "2 topics with a pose, /odom, /other; "
            "name those that are meant with --topics",
        ),
        ({"turned": True}, "'vx' says; is it of the other sign"),
    ],
)
def test_a_fault_of_a_bag_is_one_line(make_bag, how, words):
    path = make_bag(**how)
    with pytest.raises(RecordingError) as error:
        read_drives(path, BODY)
    assert words in str(error.value)
    assert str(path) in str(error.value)
    assert "\n" not in str(error.value)


def test_a_column_that_no_topic_has_is_named(make_bag):
    body = Body(
        name="wheeled",
        pose="planar",
        columns=(("wheel", "rad/s"),),
        actions=(("linear", "m/s"),),
    )
    with pytest.raises(
        RecordingError, match="column 'wheel' of body 'wheeled' is in no topic"
    ):
        read_drives(make_bag(), body)


@pytest.mark.parametrize("ros", [1, 2])
def test_a_bag_that_is_cut_off_is_named(make_bag, ros):
    path = make_bag(ros)
    file = path if ros == 1 else next(path.glob("*.db3"))
    file.write_bytes(file.read_bytes()[: file.stat().st_size // 2])
    with pytest.raises(RecordingError) as error:
        read_drives(path, BODY)
    assert str(path) in str(error.value) and "\n" not in str(error.value)


def test_of_several_topics_those_that_are_named_are_read(make_bag):
    path = make_bag(twice="/other")
    (drive,) = read_drives(path, BODY, ["/other", "/cmd_vel"])
    assert len(drive.actions) >= 38
    with pytest.raises(
        RecordingError,
        match="unknown topic '/odon'; did you mean '/odom'",
    ):
        read_drives(path, BODY, ["/odon", "/cmd_vel"])


def body_of(columns: dict[str, str], actions: dict[str, str]) -> Body:
    """A body with a planar pose."""
    return Body(
        name="robot",
        pose="planar",
        columns=tuple(columns.items()),
        actions=tuple(actions.items()),
    )


@pytest.mark.parametrize("ros", [1, 2])
def test_positions_and_efforts_of_joints_stand_beside_velocities(make_bag, ros):
    path = make_bag(ros, ("/odom", "/cmd_vel", "/joint_states"))
    columns = {
        "left_wheel": "rad/s",
        "right_wheel": "rad/s",
        "left_wheel_position": "rad",
        "right_wheel_effort": "N m",
    }
    (drive,) = read_drives(path, body_of(columns, {"linear": "m/s"}))
    left, right, position, effort = drive.states[:, 3:].T
    assert np.allclose(right, 2 * left) and np.allclose(position, left**2 / 4)
    assert np.allclose(effort, 2 + left / 2)


@pytest.mark.parametrize("ros", [1, 2])
@pytest.mark.parametrize("topic", ["/drive", "/drive_stamped"])
def test_commands_of_cars_are_read(make_bag, ros, topic):
    path = make_bag(ros, ("/odom", topic))
    body = body_of({"yaw_rate": "rad/s"}, {"speed": "m/s", "steering_angle": "rad"})
    (drive,) = read_drives(path, body)
    speed, steering = drive.actions.T
    assert np.allclose(steering, 0.1 * (speed - 1), atol=1e-6)
    assert np.allclose(np.diff(speed), 0.1, atol=1e-5)


def test_a_bag_without_definitions_of_messages_is_read(make_bag):
    """Bags of ROS 2 have had definitions since 2023."""
    path = make_bag(2, ("/odom", "/drive_stamped"))
    with sqlite3.connect(next(path.glob("*.db3"))) as database:
        database.execute("DELETE FROM message_definitions")
    body = body_of({"yaw_rate": "rad/s"}, {"speed": "m/s"})
    assert len(read_drives(path, body)) == 1


@pytest.mark.parametrize("topic", ["/wheels", "/motors"])
def test_an_array_is_the_command_where_no_other_topic_is(make_bag, topic, tmp_path):
    body = body_of({"yaw_rate": "rad/s"}, {"command_0": "1", "command_1": "1"})
    path = make_bag(2, ("/odom", topic))
    (drive,) = read_drives(path, body)
    assert np.allclose(np.diff(drive.actions, axis=0), [0.1, -0.1], atol=1e-5)
    shutil.rmtree(path)
    assert len(read_drives(make_bag(2, ("/odom", "/cmd_vel", topic)), BODY)) == 1


def test_of_two_arrays_one_must_be_named(make_bag):
    body = body_of({"yaw_rate": "rad/s"}, {"command_0": "1"})
    path = make_bag(2, ("/odom", "/wheels", "/motors"))
    with pytest.raises(RecordingError, match="2 topics with a command, /motors, /whee"):
        read_drives(path, body)
    assert len(read_drives(path, body, ["/odom", "/wheels"])) == 1


def test_a_pause_of_the_poses_or_of_a_sensor_divides_a_bag(make_bag):
    """Nothing is interpolated across the pause; another topic's pause is no fault."""
    topics = ("/odom", "/cmd_vel", "/joint_states")
    wheeled = body_of({"right_wheel": "rad/s"}, {"linear": "m/s"})
    path = make_bag(2, topics, without={"/joint_states": (1.51, 2.49)})
    with pytest.warns(RecordingWarning, match="1 pause .1.5 s after its start.: 2 d"):
        first, second = read_drives(path, wheeled)
    assert (len(first), len(second)) == (15, 14)
    assert first.session == second.session
    assert np.allclose(np.diff(second.states[:, 3]), 0.4)
    assert len(read_drives(path, BODY)) == 1
    shutil.rmtree(path)
    path = make_bag(2, topics, without={"/odom": (1.51, 2.49)})
    with pytest.warns(RecordingWarning, match="1 pause"):
        assert len(read_drives(path, BODY)) == 2


def test_a_file_inside_a_bag_is_named(make_bag):
    path = make_bag()
    inner = next(path.glob("*.db3"))
    with pytest.raises(RecordingError) as error:
        read_drives(inner, BODY)
    assert str(error.value) == (
        f"{inner}: it is a file inside a ROS 2 bag; give the bag's folder, {path}"
    )


@pytest.mark.parametrize("ros", [1, 2])
def test_a_body_that_is_guessed_from_a_bag_reads_it(make_bag, tmp_path, ros):
    path = make_bag(ros, ("/odom", "/drive", "/joint_states"))
    guess = guess_body(path)
    (tmp_path / "robot.yaml").write_text(guess.text)
    assert read_body(tmp_path / "robot.yaml") == guess.body
    assert guess.body.pose == "planar" and guess.body.rate == 10
    assert dict(guess.body.columns) == {
        "vx": "m/s",
        "yaw_rate": "rad/s",
        "left_wheel": "rad/s",
        "right_wheel": "rad/s",
    }
    assert dict(guess.body.actions) == {"speed": "m/s", "steering_angle": "rad"}
    assert guess.left_out["vy"] == "it never changes"
    assert guess.left_out["left_wheel_effort"] == "N m; add it if it helps"
    assert len(read_drives(path, tmp_path / "robot.yaml")) == 1
    assert inspect_drives(path, guess.body)["faults"] == []
