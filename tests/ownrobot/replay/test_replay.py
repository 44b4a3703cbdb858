"""Rides in three dimensions: the data that the browser receives."""

import base64
import json
import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.spatial.transform import Rotation

from ownrobot.__main__ import main
from ownrobot.recordings import write_drives
from ownrobot.replay import (
    ROBOTS,
    drives_scene,
    read_scene,
    replay,
    ride,
    rides_scene,
    write_scene,
)
from ownrobot.replay.packing import pack, unpack
from ownrobot.replay.scene import attitudes_on_ground, level_ground, rolling_angles
from ownrobot.replay.scene_file import scene_json
from ownrobot.replay.skeleton import (
    BOXES,
    box_skeleton,
    find_box,
    heave_curves,
    rover_skeleton,
)
from sidm.body import ROVER, Body
from sidm.config import ConfigError
from sidm.drives import Drive, Ground
from sidm.simulation import Simulator
from sidm.simulation.robot import WHEELS
from sidm.systems import Physics, Terrain
from sidm.terrain import generate_terrain

GROUND = Terrain(cell_height_scale=0.35)
PLANAR = Body(
    name="cart",
    pose="planar",
    columns=(("speed", "m/s"),),
    actions=(("left", "1"), ("right", "1")),
)


@given(
    arrays(np.int16, st.tuples(st.integers(1, 3), st.integers(1, 5), st.integers(1, 4)))
)
def test_what_is_packed_is_unpacked(numbers):
    assert np.array_equal(unpack(pack(numbers), numbers.shape), numbers)


def places(skeleton, position, quaternion, joints):
    """Place of every part's frame in the world, by the skeleton's own rules."""
    frames = []
    for number, part in enumerate(skeleton["parts"]):
        turn, origin = (
            frames[part["parent"]]
            if number
            else (Rotation.from_quat(quaternion), position)
        )
        origin = origin + turn.apply(part["at"])
        if "joint" in part:
            turn = turn * Rotation.from_rotvec(
                joints[part["joint"]] * np.array(part["axis"])
            )
        frames.append((turn, origin))
    return frames


@pytest.mark.parametrize("motors", [True, False], ids=["braked", "free"])
def test_the_drawn_wheels_are_where_the_simulated_ones_are(motors):
    robot = ROBOTS["system2 expert"]
    skeleton = rover_skeleton(robot, motors)
    with Simulator(
        robot, generate_terrain(GROUND, 3), Physics(strut_motors=motors)
    ) as simulator:
        simulator.reset()
        for steering in (0.0, 0.5, 0.8, 0.8, -0.3, -0.8):
            state = simulator.step(np.array([0.8, steering]))
        frames = places(skeleton, state[:3], state[3:7], simulator.joint_angles)
        wheels = [
            one
            for one, part in zip(frames, skeleton["parts"], strict=True)
            if part.get("joint") in range(4, 8)
        ]
        for name, joint, (turn, origin) in zip(
            WHEELS, simulator._wheels, wheels, strict=True
        ):
            place, quaternion = simulator._client.getLinkState(
                simulator._body, joint, 0, 1
            )[4:6]
            assert origin == pytest.approx(place, abs=5e-4), name
            assert (turn.inv() * Rotation.from_quat(quaternion)).magnitude() < 2e-3, (
                name
            )


def test_struts_are_as_long_as_their_travel_says():
    """On even ground the links do not give; at zero travel a strut is 0.16 m long."""
    even = Terrain(cell_height_scale=0.0, noise_height_scale=0.0)
    simulated = ride(
        ROBOTS["system2 expert"], even, 0, 0.0, steps=2, strut_motors=False
    )
    skeleton = rover_skeleton(simulated.robot, False)
    frames = places(
        skeleton,
        simulated.states[-1, :3],
        simulated.states[-1, 3:7],
        simulated.joints[-1],
    )
    for rod, strut in zip(
        [rod for rod in skeleton["rods"] if rod["kind"] == "strut"],
        simulated.struts[-1],
        strict=True,
    ):
        ends = [
            frames[part][1] + frames[part][0].apply(point)
            for part, point in rod["ends"]
        ]
        assert np.linalg.norm(ends[0] - ends[1]) == pytest.approx(
            0.16 - strut, abs=1.5e-3
        )


def test_the_heave_follows_from_the_struts():
    """The formula is that of explorer.js."""
    simulated = ride(
        ROBOTS["system2 expert"], GROUND, 3, 0.8, steps=5, strut_motors=False
    )
    for axle, (a, b, c) in enumerate(heave_curves(simulated.robot, False)):
        rest = c - simulated.struts[:, 2 * axle : 2 * axle + 2].mean(1)
        assert -2 * rest / (b + np.sqrt(b * b - 4 * a * rest)) == pytest.approx(
            simulated.joints[:, 2 * axle], abs=1e-4
        )
    assert heave_curves(simulated.robot, True)[0] is None


def test_a_scene_is_what_was_ridden(rides):
    """The browser's numbers agree to a millimetre and a thousandth of a radian."""
    scene = json.loads(json.dumps(scene_json(rides_scene(rides))))
    assert [track["name"] for track in scene["tracks"]] == list(rides)
    assert [bool(track["ghost"]) for track in scene["tracks"]] == [False, True]
    for track, one in zip(scene["tracks"], rides.values(), strict=True):
        numbers = (
            unpack(
                base64.b64decode(track["motion"]),
                (track["moments"], len(track["scales"])),
            )
            / track["scales"]
        )
        assert numbers[:, :3] == pytest.approx(one.states[:, :3], abs=1e-3)
        assert np.abs((numbers[:, 3:7] * one.states[:, 3:7]).sum(1)) == pytest.approx(
            1, abs=1e-3
        )
        assert numbers[:, 7:] == pytest.approx(one.joints, abs=1e-3)
        assert track["step"] == 0.05
    below = scene["ground"]
    heights = (
        unpack(base64.b64decode(below["motion"]), (below["rows"], below["columns"], 1))[
            ..., 0
        ]
        / below["scale"]
    )
    row, column = (round((14.95 + below[name]) / 0.1) for name in ("low", "left"))
    whole = rides["system1 novice"].heights
    assert heights == pytest.approx(
        whole[row : row + below["rows"], column : column + below["columns"]], abs=1e-3
    )


def test_a_scene_comes_back_from_its_file(rides, tmp_path):
    scene = rides_scene(rides)
    write_scene(tmp_path / "ride.npz", scene)
    repeated = read_scene(tmp_path / "ride.npz")
    assert [track.name for track in repeated.tracks] == list(rides)
    assert repeated.distance == scene.distance
    assert repeated.tracks[1].joints == pytest.approx(scene.tracks[1].joints, abs=1e-5)
    assert repeated.tracks[0].skeleton == scene.tracks[0].skeleton
    first, second = scene_json(scene), scene_json(repeated)
    assert first["tracks"] == second["tracks"]
    assert first["ground"]["rows"] == second["ground"]["rows"]


def test_a_page_holds_all_that_it_needs(rides, tmp_path):
    view = replay(rides, "Novice & expert")
    view.write(tmp_path / "page.html")
    text = (tmp_path / "page.html").read_text()
    assert "<title>Novice &amp; expert</title>" in text and len(text) < 400_000
    assert re.findall(r"""(?:src|href)=["'](?!data:)|url\(|@import""", text) == []
    frame = view._repr_html_()
    # escaped, because it stands inside srcdoc
    assert frame.startswith("<iframe") and "<script" not in frame


def test_rolling_wheels_turn_as_far_as_the_way_is_long():
    """Wheels roll straight ahead.

    When the robot turns on the spot, right wheels go forward and left ones back.
    """
    position, ahead = np.zeros((11, 3)), np.tile([0.0, 0, 0, 1], (11, 1))
    position[:, 0] = np.linspace(0, 2, 11)
    assert rolling_angles(position, ahead, 0.1)[-1] == pytest.approx([20.0] * 4)
    turning = Rotation.from_euler("z", np.linspace(0, 1, 11)[:, None]).as_quat()
    assert rolling_angles(np.zeros((11, 3)), turning, 0.1, 0.2)[-1] == pytest.approx(
        [2, -2, 2, -2]
    )


def test_a_robot_on_a_slope_is_tilted():
    """Uphill along x the nose is up, which is negative pitch.

    The same slope from the side is a roll.
    """
    heights = np.tile(0.1 * np.arange(100) * 0.2, (100, 1))
    path = np.stack([np.linspace(-2, 2, 9), np.zeros(9)], axis=1)
    ground = Ground(heights, 0.1)
    assert attitudes_on_ground(path, ground, 0.6, 0.4).as_euler("ZYX")[
        4
    ] == pytest.approx([0, -np.arctan(0.2), 0], abs=1e-6)
    assert attitudes_on_ground(path[:, ::-1], ground, 0.6, 0.4).as_euler("ZYX")[
        4
    ] == pytest.approx([np.pi / 2, 0, -np.arctan(0.2)], abs=1e-6)


def cart(steps=20):
    """A recorded drive in the plane."""
    time = np.arange(steps + 1) / 10
    states = np.stack(
        [time, 0.1 * time**2, np.arctan(0.2 * time), np.hypot(1, 0.2 * time)], axis=1
    )
    return Drive(states, np.stack([time, -time], axis=1)[:-1] / 10, PLANAR, name="cart")


def test_a_recorded_drive_rolls_over_level_ground():
    scene = drives_scene([cart()], BOXES["husky"])
    track = scene.tracks[0]
    assert track.position[:, :2] == pytest.approx(cart().states[:, :2])
    assert not scene.ground.heights.any()
    frames = places(
        track.skeleton, track.position[7], track.quaternion[7], track.joints[7]
    )
    assert [origin[2] for _, origin in frames[1:]] == pytest.approx(
        [BOXES["husky"].radius] * 4
    )
    assert track.joints[-1].mean() == pytest.approx(
        2.05 / BOXES["husky"].radius, rel=0.02
    )


def test_a_body_without_a_pose_cannot_be_shown():
    with pytest.raises(ConfigError, match="'belt' has no pose"):
        belt = Body(
            name="belt", pose="none", columns=(("v", "m/s"),), actions=(("u", "1"),)
        )
        drives_scene([Drive(np.zeros((9, 1)), np.zeros((8, 1)), belt)])


def test_the_command_writes_a_page(rides, tmp_path, capsys):
    write_scene(tmp_path / "ride.npz", rides_scene(rides))
    page = tmp_path / "out.html"
    assert main(["replay", str(tmp_path / "ride.npz"), "--html", str(page)]) == 0
    assert "system2 expert" in page.read_text() and str(page) in capsys.readouterr().out


def test_the_command_shows_recordings(tmp_path, capsys):
    write_drives(tmp_path / "cart.csv", [cart()], "made up")
    (tmp_path / "cart.yaml").write_text(
        "pose: planar\ncolumns: {speed: m/s}\nactions: {left: 1, right: 1}\n"
        "rate: 10 Hz\n"
    )
    files = {
        name: str(tmp_path / name) for name in ("cart.csv", "cart.yaml", "cart.html")
    }
    arguments = (
        f"replay {files['cart.csv']} --body {files['cart.yaml']} --html "
        f"{files['cart.html']}"
    ).split()
    assert main([*arguments, "--shape", "0.5,0.4,0.1"]) == 0
    assert main([*arguments, "--drive", "3"]) == 2
    assert main([*arguments, "--shape", "husk"]) == 2
    assert main([*arguments, "--shape", "inf,0.4,0.1"]) == 2
    error = capsys.readouterr().err
    assert "drives 0 to 0, not 3" in error and "husky" in error
    assert main(["replay", str(tmp_path / "none.npz"), "--html", "x"]) == 1


def test_the_papers_recordings_have_the_papers_robot():
    """The recordings are of the released simulator, with its ground."""
    from ownrobot.recordings import read_drives

    drive = read_drives("recordings/system1.npz", ROVER)[0]
    scene = drives_scene([drive], ROBOTS["system1 novice"])
    assert scene.tracks[0].joints.shape == (65, 10)
    assert scene.ground.heights is drive.ground.heights
    assert scene.tracks[0].position == pytest.approx(drive.states[:, :3])


def test_shapes_are_named_or_measured():
    assert find_box("warthog") is BOXES["warthog"]
    assert find_box("0.5,0.4,0.1").wheelbase == 0.5
    for words in ("0.5,0.4", "0.5,-0.4,0.1"):
        with pytest.raises(ConfigError):
            find_box(words)
    assert box_skeleton(BOXES["warthog"])["parts"][0]["at"][2] > 0


def test_level_ground_reaches_around_the_way():
    ground = level_ground(np.array([[0.0, 0.0], [10.0, 2.0]]))
    rows, columns = ground.heights.shape
    assert (columns - 1) * ground.spacing >= 26
    assert (rows - 1) * ground.spacing >= 18
    assert ground.centre == (5.0, 1.0)
