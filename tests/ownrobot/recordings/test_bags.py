"""ROS bags are written with the library and read back; their faults are named."""

import shutil
import sqlite3
from typing import Any

import numpy as np
import pytest
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from ownrobot.__main__ import main
from ownrobot.body_file import read_body
from ownrobot.recordings import (
    RecordingError,
    RecordingWarning,
    guess_body,
    read_drives,
)
from ownrobot.recordings.messages import ACKERMANN
from ownrobot.recordings.topics import read_topics
from tests.ownrobot.cart import planar

BODY = planar(
    "robot", {"vx": "m/s", "yaw_rate": "rad/s"}, {"linear": "m/s", "angular": "rad/s"}
)
WHEELED = planar("robot", {"wheel": "rad/s"}, {"linear": "m/s"})


def messages(store, time: float, turned: bool) -> dict[str, Any]:
    """Topic -> its message at a time, s, of a robot on a circle of 2 m."""
    kinds = {name.rpartition("/")[2]: kind for name, kind in store.types.items()}
    vector, twist, ahead = kinds["Vector3"], kinds["Twist"], -1 if turned else 1
    stamp = store.types["builtin_interfaces/msg/Time"](0, 0)
    number = {"seq": 0} if "seq" in kinds["Header"].__annotations__ else {}
    header = kinds["Header"](**number, stamp=stamp, frame_id="odom")
    yaw, spare, layout = 0.5 * time, np.zeros(36), kinds["MultiArrayLayout"]([], 0)
    pose = kinds["Pose"](
        kinds["Point"](2 * np.sin(yaw), 2 - 2 * np.cos(yaw), 0.0),
        kinds["Quaternion"](0.0, 0.0, np.sin(yaw / 2), np.cos(yaw / 2)),
    )
    speed, yaw_rate = ahead * (1 + 0.01 * np.sin(time)), 0.5 + 0.01 * np.sin(time)
    motion = twist(vector(speed, 0.0, 0.0), vector(0.0, 0.0, yaw_rate))
    pair = np.array([time, -time])
    drive = kinds["AckermannDrive"](0.1 * time, 0.0, 1 + time, 0.0, 0.0)
    odometry = kinds["Odometry"](
        header,
        "base",
        kinds["PoseWithCovariance"](pose, spare),
        kinds["TwistWithCovariance"](motion, spare),
    )
    return {
        "/odom": odometry,
        "/other": odometry,
        "/cmd_vel": twist(
            vector(np.cos(time), 0.0, 0.0), vector(0.0, 0.0, np.sin(time))
        ),
        "/joint_states": kinds["JointState"](
            header,
            ["left-wheel", "right_wheel"],
            np.array([time**2, 2 * time**2]),
            np.array([2 * time, 4 * time]),
            np.array([1 + time, 2 + time]),
        ),
        "/drive": drive,
        "/drive_stamped": kinds["AckermannDriveStamped"](header, drive),
        "/wheels": kinds["Float64MultiArray"](layout, pair),
        "/motors": kinds["Float32MultiArray"](layout, pair.astype(np.float32)),
    }


@pytest.fixture
def make_bag(tmp_path):
    """Write a bag; `without` says from when to when, s, a topic has no messages."""

    def make(
        ros: int = 2,
        topics=("/odom", "/cmd_vel"),
        without: dict[str, tuple[float, float]] | None = None,
        turned: bool = False,
        name: str = "drive",
        start: float = 10.0,
    ):
        path = tmp_path / (f"{name}.bag" if ros == 1 else name)
        store = get_typestore(Stores.ROS1_NOETIC if ros == 1 else Stores.ROS2_HUMBLE)
        for name, definition in ACKERMANN.items():
            store.register(get_types_from_msg(definition, name))
        writer = Writer1(path) if ros == 1 else Writer2(path, version=9)
        write = store.serialize_ros1 if ros == 1 else store.serialize_cdr
        connections = {}
        with writer:
            for step in range(81):
                time = 0.05 * step
                together = messages(store, time, turned)
                for topic in topics:
                    first, last = (without or {}).get(topic, (99, 99))
                    if first < time < last:
                        continue
                    message = together[topic]
                    kind = message.__msgtype__
                    if topic not in connections:
                        connections[topic] = writer.add_connection(
                            topic, kind, typestore=store
                        )
                    early = 0.01 if topic == "/cmd_vel" else 0.0
                    moment = int((start + time - early) * 1e9)
                    writer.write(connections[topic], moment, write(message, kind))
        return path

    return make


@pytest.mark.parametrize(("ros", "command"), [(1, "/drive"), (2, "/drive_stamped")])
def test_a_bag_is_read_as_a_drive(make_bag, ros, command):
    """Bags of ROS 2 have had definitions of messages since 2023."""
    path = make_bag(ros, ("/odom", command, "/joint_states"))
    if ros == 2:
        with sqlite3.connect(next(path.glob("*.db3"))) as database:
            database.execute("DELETE FROM message_definitions")
    columns = {"left_wheel": "rad/s", "right_wheel": "rad/s"}
    columns |= {"left_wheel_position": "rad", "right_wheel_effort": "N m"}
    body = planar("robot", columns, {"speed": "m/s", "steering_angle": "rad"})
    (drive,) = read_drives(path, body)
    assert 38 <= len(drive) <= 40
    assert np.allclose(np.diff(drive.states[:, 2]), 0.05, atol=1e-6)
    assert np.allclose(np.hypot(*(drive.states[:, :2] - [0, 2]).T), 2, atol=1e-3)
    left, right, position, effort = drive.states[:, 3:].T
    assert np.allclose(right, 2 * left) and np.allclose(position, left**2 / 4)
    assert np.allclose(effort, 2 + left / 2)
    speed, steering = drive.actions.T
    assert np.allclose(steering, 0.1 * (speed - 1), atol=1e-6)
    assert np.allclose(np.diff(speed), 0.1, atol=1e-5)


def test_an_array_is_the_command_where_no_other_topic_is(make_bag):
    body = planar("robot", {"yaw_rate": "rad/s"}, {"command_0": "1", "command_1": "1"})
    path = make_bag(2, ("/odom", "/motors"))
    (drive,) = read_drives(path, body)
    assert np.allclose(np.diff(drive.actions, axis=0), [0.1, -0.1], atol=1e-5)
    shutil.rmtree(path)
    (drive,) = read_drives(make_bag(2, ("/odom", "/cmd_vel", "/motors")), BODY)
    time = np.arange(len(drive)) / 10
    assert np.allclose(drive.actions[:, 0], np.cos(time), atol=0.15)


@pytest.mark.parametrize(
    ("how", "body", "words"),
    [
        ({"topics": ("/odom",)}, BODY, "no topic with a command (geometry_msgs/msg/T"),
        ({"topics": ("/cmd_vel",)}, BODY, "no topic with a pose"),
        ({"topics": ("/odom", "/other")}, BODY, "2 topics with a pose, /odom, /other"),
        (
            {"topics": ("/odom", "/wheels", "/motors")},
            BODY,
            "2 topics with a command, /motors, /wheels",
        ),
        ({"turned": True}, BODY, "'vx' says; is it of the other sign"),
        ({}, WHEELED, "column 'wheel' of body 'robot' is in no topic"),
    ],
)
def test_a_fault_of_a_bag_is_one_line(make_bag, how, body, words):
    path = make_bag(**how)
    with pytest.raises(RecordingError) as error:
        read_drives(path, body)
    assert words in str(error.value)
    assert str(path) in str(error.value) and "\n" not in str(error.value)


@pytest.mark.parametrize("ros", [1, 2])
def test_a_bag_that_is_cut_off_is_named(make_bag, ros):
    path = make_bag(ros)
    file = path if ros == 1 else next(path.glob("*.db3"))
    file.write_bytes(file.read_bytes()[: file.stat().st_size // 2])
    with pytest.raises(RecordingError) as error:
        read_drives(path, BODY)
    assert str(path) in str(error.value) and "\n" not in str(error.value)


def test_names_of_both_robots_topics_stand_together(make_bag):
    """Each bag has several topics of a kind, and not those of the other."""
    novice = make_bag(2, ("/odom", "/other", "/cmd_vel"), name="novice")
    expert = make_bag(2, ("/odom", "/wheels", "/motors"), name="expert")
    named = ("/odom", "/cmd_vel", "/wheels")
    commands = [{*read_topics(path, named)[0][0].command} for path in (novice, expert)]
    assert "angular" in commands[0] and commands[1] == {"command_0", "command_1"}


def test_of_several_topics_those_that_are_named_are_read(make_bag, tmp_path):
    path = make_bag(2, ("/odom", "/other", "/cmd_vel"))
    assert len(read_drives(path, BODY, ["/other", "/cmd_vel"])) == 1
    with pytest.raises(RecordingError, match="topic '/odon'; did you mean '/odom'"):
        read_drives(path, BODY, ["/odon", "/cmd_vel"])
    (tmp_path / "drive.csv").write_text("")
    with pytest.raises(RecordingError, match="leave --topics out"):
        read_drives(tmp_path / "drive.csv", BODY, ["/odom"])


def test_a_pause_of_the_poses_or_of_a_sensor_divides_a_bag(make_bag):
    """Nothing is interpolated across the pause; another topic's pause is no fault."""
    topics = ("/odom", "/cmd_vel", "/joint_states")
    wheeled = planar("robot", {"right_wheel": "rad/s"}, {"linear": "m/s"})
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


def test_a_body_that_is_guessed_from_a_bag_reads_it(make_bag, tmp_path):
    path = make_bag(2, ("/odom", "/drive", "/joint_states"))
    guess = guess_body(path)
    (tmp_path / "robot.yaml").write_text(guess.text)
    assert read_body(tmp_path / "robot.yaml") == guess.body
    assert guess.body.pose == "planar" and guess.body.rate == 10
    rates = dict.fromkeys(("yaw_rate", "left_wheel", "right_wheel"), "rad/s")
    assert dict(guess.body.columns) == {"vx": "m/s"} | rates
    assert dict(guess.body.actions) == {"speed": "m/s", "steering_angle": "rad"}
    assert guess.left_out["vy"] == "it never changes"
    assert guess.left_out["left_wheel_effort"] == "N m; add it if it helps"
    assert main(["check", str(path), "--body", str(tmp_path / "robot.yaml")]) == 0


@pytest.mark.parametrize("ros", [1, 2])
def test_bags_that_a_recorder_split_are_one_session(make_bag, ros):
    """A bag lasts 4 s; the third begins much later, and the fourth goes on from it."""
    starts = {"run_0": 10, "run_1": 14.05, "run_2": 100, "run_3": 104.05, "lone_7": 108}
    paths = [make_bag(ros, name=name, start=start) for name, start in starts.items()]
    sessions = [drive.session for drive in read_drives(paths, BODY)]
    assert [sessions.index(one) for one in sessions] == [0, 0, 2, 2, 4]
    named = [f"noon={path}" for path in paths[1:3]]
    assert {d.session for d in read_drives(named, BODY)} == {"noon"}
