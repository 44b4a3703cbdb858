"""Messages of a bag on one clock: stamps count, and commands hold between poses."""

import numpy as np
import pytest

from ownrobot.recordings.bags import _held_means, _notes_of_commands, bag_columns
from ownrobot.recordings.clocks import Messages, on_one_clock
from ownrobot.recordings.table import RecordingError
from ownrobot.recordings.topics import Samples, Topics, _parts

TIME = np.arange(0, 30, 0.05)  # s, at which a robot was somewhere


def topic(name, received, stamps=None, **columns):
    rows = np.arange(len(received))
    found = {column: (rows, np.asarray(values)) for column, values in columns.items()}
    return Messages(name, received, stamps, found)


@pytest.mark.parametrize(
    "received_of, told",
    [
        (lambda t: 1e9 + t / 0.7, "span 42.79 s by their times of receipt and 29.95 s"),
        (lambda t: 1e9 + t / 2.5, "span 11.98 s by their times of receipt and 29.95 s"),
        (lambda t: 5e5 + t, "/cmd_vel: without stamps, brought to the clock"),
    ],
    ids=["slow simulation", "fast simulation", "clock of another machine"],
)
def test_commands_without_stamps_come_to_the_clock_of_the_poses(received_of, told):
    pose = topic("/odom", received_of(TIME), TIME)
    commands = TIME[::4] + 0.013
    (times, held), notes = on_one_clock(
        [pose, topic("/cmd_vel", received_of(commands))]
    )
    assert np.array_equal(times, TIME)
    assert held == pytest.approx(commands, abs=1e-6)
    assert any(told in note for note in notes)


def test_a_topic_whose_name_ends_anothers_is_told_of():
    """`/front/odom` is told of for another reason."""
    pose = topic("/pose", 5e5 + TIME, TIME)
    front = topic("/front/odom", 5e5 + TIME, 0 * TIME)
    _, notes = on_one_clock([pose, front, topic("/odom", 5e5 + TIME)])
    assert any(note.startswith("/odom: without stamps") for note in notes)


def test_a_pose_that_comes_late_counts_when_it_was_measured():
    now = 1e9 + TIME
    pose, command = topic("/odom", now + 0.4, now), topic("/cmd_vel", now)
    (times, held), (note,) = on_one_clock([pose, command])
    assert np.array_equal(times, now) and np.array_equal(held, now)
    assert note == "/odom: its messages come 0.4 s after their stamps; the stamps count"


def test_a_simulations_clock_of_few_ticks_is_filled_by_the_stamps():
    """Receipt is known to 0.1 s; before the first tick it is 0."""
    ticks = np.floor(10 * TIME) / 10
    pose = topic("/odom", ticks, TIME + 100)
    (_, held), _ = on_one_clock([pose, topic("/cmd_vel", ticks)])
    assert np.isnan(held[0])
    assert held[2:] == pytest.approx(TIME[2:] + 100, abs=0.06)


@pytest.mark.parametrize(
    ("stamps_of", "words"),
    [
        (lambda t: 0 * t + 1e9, "/imu: its stamps do not grow; the times of receipt"),
        (
            lambda t: t + 50,
            "/imu: its stamps are 1e+09 s from those of /odom; the times",
        ),
    ],
    ids=["never set", "since the sensor was switched on"],
)
def test_stamps_that_cannot_be_right_do_not_count(stamps_of, words):
    now, late = 1e9 + TIME, TIME[200:]
    pose, imu = topic("/odom", now, now), topic("/imu", 1e9 + late, stamps_of(late))
    (times, found), notes = on_one_clock([pose, imu])
    assert np.array_equal(times, now) and found == pytest.approx(1e9 + late)
    assert [words in note for note in notes] == [True]


def test_a_slow_simulations_late_topic_is_of_its_clock():
    now = 1e9 + TIME / 0.3  # s of receipt; the second topic begins after a third
    topics = [topic(n, now[k:], TIME[k:]) for n, k in (("/odom", 0), ("/imu", 200))]
    times, notes = on_one_clock(topics)
    assert np.array_equal(times[1], TIME[200:])
    assert all("the stamps count" in note for note in notes) and len(notes) == 2


def test_an_action_is_the_mean_of_what_was_commanded():
    """A command of 2 for 30 ms of 100 ms and of 4 for the rest."""
    command = Samples(np.array([0.0, 0.13, 0.3]), np.array([2.0, 4.0, 0.0]))
    means = _held_means(command, np.array([0.0, 0.1, 0.2, 0.3]))
    assert means == pytest.approx([2.0, 0.3 * 2 + 0.7 * 4, 4.0, 0.0])


def robot(received, stamps, x):
    """A pose and a command of a robot on a line."""
    still = np.zeros(len(x))
    pose = dict(x=x, y=still, yaw=still, qx=still, qy=still, qz=still, qw=still + 1)
    command = topic("/cmd_vel", received, linear=still + 1, linear_y=np.arange(len(x)))
    return [topic("/odom", received, stamps, **pose), command]


def test_a_clock_that_goes_back_cuts_the_drive_and_poses_of_one_time_are_left_out():
    stamps = np.r_[TIME, TIME[50:]] + 100
    received = 1e6 + np.arange(len(stamps)) * 0.05
    parts, notes = _parts(robot(received, stamps, np.arange(len(stamps))))
    first, second = (part.pose["x"] for part in parts)
    assert len(first.values) == len(TIME) and second.values[0] == len(TIME)
    assert (np.diff(first.times) > 0).all() and (np.diff(second.times) > 0).all()
    stamps = np.repeat(TIME[:200], 2) + 100
    received = 100 + np.arange(400) * 0.025
    (part,), notes = _parts(robot(received, stamps, np.arange(400)))
    assert np.array_equal(part.pose["x"].values, np.arange(0, 400, 2))
    assert any("200 poses have the time of the pose before" in note for note in notes)


def test_every_part_of_a_command_is_read_or_named_and_a_pause_is_told():
    (part,), _ = _parts(robot(TIME + 1, TIME + 1, TIME))
    wanted = ["x", "y", "yaw", "linear", "linear_y"]
    columns = bag_columns(part, wanted, "mecanum")
    assert np.ptp(columns["linear_y"]) > 500
    assert _notes_of_commands([part], wanted) == []
    (note,) = _notes_of_commands([part], ["linear"])
    assert note.startswith("linear_y of the command changes and is not read")
    times = np.r_[0:5:0.1, 8:10:0.1]
    paused = Topics({}, {}, {"linear": Samples(times, np.sin(times))})
    (note,) = _notes_of_commands([paused], ["linear"])
    assert "pause for up to 3.1 s" in note


@pytest.mark.parametrize("length", [0.0, 0.9, 1.01])
def test_orientations_that_are_none_are_refused(length):
    pose, command = robot(TIME + 1, TIME + 1, TIME)
    rows, _ = pose.columns["qw"]
    pose.columns["qw"] = rows, np.full(len(rows), length)
    (part,), _ = _parts([pose, command])
    with pytest.raises(RecordingError, match=f"length {length:.4g}, not 1"):
        bag_columns(part, ["x", "y", "yaw", "linear"], "cart")
    assert "x" in bag_columns(part, ["x", "linear"], "without yaw")
