"""ROS bags are written with the library and read back.

Poses, velocities and commands are read, and faults of a bag are named.
"""

import numpy as np
import pytest
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_typestore

from sidm.body import Body
from sidm.recordings import RecordingError, read_drives

BODY = Body(
    name="rover",
    pose="planar",
    columns=(("vx", "m/s"), ("yaw_rate", "rad/s")),
    actions=(("linear", "m/s"), ("angular", "rad/s")),
)


def messages(store, turned: bool = False):
    """Messages (topic, time in s, message) of a robot on a circle of 2 m.

    With `turned`, the command does not contain the turning.
    """
    kind = store.types
    stamp = kind["builtin_interfaces/msg/Time"](sec=0, nanosec=0)
    header = (
        kind["std_msgs/msg/Header"](seq=0, stamp=stamp, frame_id="odom")
        if "ROS1" in repr(store) or "seq" in kind["std_msgs/msg/Header"].__annotations__
        else kind["std_msgs/msg/Header"](stamp=stamp, frame_id="odom")
    )
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


@pytest.fixture
def make_bag(tmp_path):
    """Write a bag of ROS 1 or 2 with some topics, each possibly under several names."""

    def make(ros: int = 2, topics=("/odom", "/cmd_vel"), twice: str = "", **how):
        path = tmp_path / ("drive.bag" if ros == 1 else "drive")
        store = get_typestore(Stores.ROS1_NOETIC if ros == 1 else Stores.ROS2_HUMBLE)
        writer = Writer1(path) if ros == 1 else Writer2(path, version=9)
        write = store.serialize_ros1 if ros == 1 else store.serialize_cdr
        with writer:
            connections = {}
            for topic, time, message in messages(store, **how):
                for name in [topic] * (topic in topics) + [twice] * (
                    topic == "/odom" and bool(twice)
                ):
                    kind = message.__msgtype__
                    if name not in connections:
                        connections[name] = writer.add_connection(
                            name, kind, typestore=store
                        )
                    writer.write(
                        connections[name], int((10 + time) * 1e9), write(message, kind)
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
        match="unknown name '/odon' in the topics; did you mean '/odom'",
    ):
        read_drives(path, BODY, ["/odon", "/cmd_vel"])
