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
    drive_scene,
    replay,
    ride,
    rides_scene,
    write_scene,
)
from ownrobot.replay.scene import attitudes_on_ground, rolling_angles
from ownrobot.replay.skeleton import BOXES, heave_curves, rover_skeleton
from ownrobot.replay.viewer import pack, scene_json, unpack
from sidm.config import ConfigError, replace
from sidm.drives import Drive, Ground
from sidm.simulation import Simulator
from sidm.systems import Physics, Terrain
from sidm.terrain import generate_terrain
from tests.ownrobot.cart import CART

GROUND = Terrain(cell_height_scale=0.35)
PLANAR = replace(CART, actions=(("left", "1"), ("right", "1")))


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
    robot, terrain = ROBOTS["system2 expert"], generate_terrain(GROUND, 3)
    skeleton = rover_skeleton(robot, motors)
    with Simulator(robot, terrain, Physics(strut_motors=motors)) as simulator:
        simulator.reset()
        for steering in (0.0, 0.5, 0.8, 0.8, -0.3, -0.8):
            state = simulator.step(np.array([0.8, steering]))
        frames = places(skeleton, state[:3], state[3:7], simulator.joint_angles)
        wheels = [
            one
            for one, part in zip(frames, skeleton["parts"], strict=True)
            if part.get("joint") in range(4, 8)
        ]
        client, body = simulator._client, simulator._body
        for joint, (turn, origin) in zip(simulator._wheels, wheels, strict=True):
            place, quaternion = client.getLinkState(body, joint, 0, 1)[4:6]
            assert origin == pytest.approx(place, abs=5e-4)
            assert (turn.inv() * Rotation.from_quat(quaternion)).magnitude() < 2e-3


def test_the_heave_follows_from_the_struts():
    """The formula is that of explorer.js."""
    robot = ROBOTS["system2 expert"]
    one = ride(robot, GROUND, 3, 0.8, steps=5, strut_motors=False)
    for axle, (a, b, c) in enumerate(heave_curves(robot, False)):
        rest = c - one.struts[:, 2 * axle : 2 * axle + 2].mean(1)
        heave = -2 * rest / (b + np.sqrt(b * b - 4 * a * rest))
        assert heave == pytest.approx(one.joints[:, 2 * axle], abs=1e-4)
    assert heave_curves(robot, True)[0] is None


def test_a_scene_is_what_was_ridden_and_comes_back_from_its_file(rides, tmp_path):
    """The browser's numbers agree to a millimetre and a thousandth of a radian."""
    scene = json.loads(json.dumps(scene_json(rides_scene(rides))))
    write_scene(tmp_path / "ride.json", rides_scene(rides))
    assert json.loads((tmp_path / "ride.json").read_text()) == scene
    assert [track["name"] for track in scene["tracks"]] == list(rides)
    assert [bool(track["ghost"]) for track in scene["tracks"]] == [False, True]
    for track, one in zip(scene["tracks"], rides.values(), strict=True):
        shape = track["moments"], len(track["scales"])
        numbers = unpack(base64.b64decode(track["motion"]), shape) / track["scales"]
        assert numbers[:, :3] == pytest.approx(one.states[:, :3], abs=1e-3)
        cosines = np.abs((numbers[:, 3:7] * one.states[:, 3:7]).sum(1))
        assert cosines == pytest.approx(1, abs=1e-3)
        assert numbers[:, 7:] == pytest.approx(one.joints, abs=1e-3)
        assert track["step"] == 0.05
    below = scene["ground"]
    rows, columns = shape = below["rows"], below["columns"]
    heights = unpack(base64.b64decode(below["motion"]), (*shape, 1))[..., 0]
    row, column = (round((14.95 + below[name]) / 0.1) for name in ("low", "left"))
    whole = rides["system1 novice"].heights
    seen = whole[row : row + rows, column : column + columns]
    assert heights / below["scale"] == pytest.approx(seen, abs=1e-3)


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
    """When the robot turns on the spot, right wheels go forward and left ones back."""
    position, still = np.zeros((11, 3)), np.zeros((11, 3))
    position[:, 0] = np.linspace(0, 2, 11)
    ahead = rolling_angles(position, np.tile([0.0, 0, 0, 1], (11, 1)), 0.1)
    assert ahead[-1] == pytest.approx([20.0] * 4)
    turning = Rotation.from_euler("z", np.linspace(0, 1, 11)[:, None]).as_quat()
    spun = rolling_angles(still, turning, 0.1, 0.2)
    assert spun[-1] == pytest.approx([2, -2, 2, -2])


def test_a_robot_on_a_slope_is_tilted():
    """The nose is up, which is negative pitch; from the side it is a roll."""
    ground = Ground(np.tile(0.1 * np.arange(100) * 0.2, (100, 1)), 0.1)
    place, slope = np.zeros((1, 2)), np.arctan(0.2)
    for yaw, pitch, roll in ((0, -slope, 0), (np.pi / 2, 0, -slope)):
        attitude = attitudes_on_ground(place, np.array([yaw]), ground, 0.6, 0.4)
        found = attitude.as_euler("ZYX")[0]
        assert found == pytest.approx([yaw, pitch, roll], abs=1e-6)


@pytest.fixture
def cart() -> Drive:
    time = np.arange(21) / 10
    speed = np.hypot(1, 0.2 * time)
    states = np.stack([time, 0.1 * time**2, np.arctan(0.2 * time), speed], axis=1)
    actions = np.stack([time, -time], axis=1)[:-1] / 10
    return Drive(states, actions, PLANAR, name="cart")


def test_a_recorded_drive_stands_on_level_ground_and_needs_a_pose(cart):
    scene = drive_scene(cart)
    track = scene.tracks[0]
    far = drive_scene(replace(cart, states=cart.states + [5e5, 4.5e6, 0, 0]))
    assert np.allclose(far.tracks[0].position, track.position, atol=1e-6)
    assert track.position[:, :2] == pytest.approx(cart.states[:, :2])
    frames = places(
        track.skeleton, track.position[7], track.quaternion[7], track.joints[7]
    )
    radius = BOXES["husky"].radius
    assert [at[2] for _, at in frames[1:]] == pytest.approx([radius] * 4)
    rover = ROBOTS["system1 novice"]  # the same drive on the paper's robot
    assert drive_scene(cart, rover).tracks[0].joints.shape == (21, 10)
    belt = replace(PLANAR, name="belt", pose="none")
    with pytest.raises(ConfigError, match="'belt' has no pose"):
        drive_scene(replace(cart, states=cart.states[:, 3:], body=belt))


def test_the_command_writes_a_page_of_a_scene_and_of_recordings(
    rides, cart, tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    write_scene(tmp_path / "ride.json", rides_scene(rides))
    assert main(["replay", "ride.json", "--html", "out.html"]) == 0
    assert "out.html" in capsys.readouterr().out
    page = replay(rides, "ride.json").page()
    assert (tmp_path / "out.html").read_text() == page and "system2 expert" in page
    assert main(["replay", "ride.json", "--html", "x", "--drive", "1"]) == 2
    assert "--drive is of recorded drives" in capsys.readouterr().err
    for name, content in (("list", "[]"), ("no", "{}"), ("text", "a scene")):
        (tmp_path / f"{name}.json").write_text(content)
        assert main(["replay", f"{name}.json", "--html", "x"]) == 1
        assert f"{name}.json: it holds no scene" in capsys.readouterr().err
    write_drives("cart.csv", [cart], "made up")
    (tmp_path / "cart.yaml").write_text(
        "pose: planar\ncolumns: {speed: m/s}\nactions: {left: 1, right: 1}\n"
    )
    words = "replay cart.csv --body cart.yaml --html cart.html"
    assert main([*words.split(), "--shape", "0.5,0.4,0.1"]) == 0
    for wrong, said in (
        ("--drive 3", "drives 0 to 0, not 3"),
        ("--shape husk", "husky"),
        ("--shape 0.5,-0.4,0.1", "are positive lengths in m"),
        ("--shape inf,0.4,0.1", "are positive lengths in m"),
    ):
        assert main([*words.split(), *wrong.split()]) == 2
        assert said in capsys.readouterr().err
    for missing in ("none.npz", "none.json"):
        assert main(["replay", missing, "--html", "x"]) == 1
