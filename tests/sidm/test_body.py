"""Bodies: data that follow from a body, its file, and each fault of a file."""

import dataclasses

import pytest

from ownrobot.body_file import body_from_mapping, body_to_mapping, read_body
from sidm.body import ROVER, SI, Body, units_like
from sidm.config import ConfigError

WARTHOG = """
pose: planar
columns: {yaw_rate: rad/s, wheel_left: rad/s, wheel_right: rad/s}
actions: {command_left: rad/s, command_right: rad/s}
rate: 10 Hz
"""


def test_the_papers_body_has_11_inputs_and_13_targets():
    assert (len(ROVER.inputs), len(ROVER.targets), len(ROVER.state)) == (11, 13, 13)
    assert ROVER.inputs[::3] == ("up x", "vx", "wx", "throttle")
    assert ROVER.resolutions == (1e-4,) * 3 + (1e-6,) * 4 + (1e-3,) * 6
    assert ROVER.pixels(32) == 32
    assert dataclasses.replace(ROVER, map_size=3.0, map_pixels=16).pixels(32) == 16


def test_a_file_says_what_a_planar_robot_sees_and_does(tmp_path):
    path = tmp_path / "warthog.yaml"
    path.write_text(WARTHOG + "resolution: {left: 1 mm, yaw_rate: 2deg/s}\n")
    body = read_body(path)
    columns = ("yaw_rate", "wheel_left", "wheel_right")
    assert body.name == "warthog"
    assert body.inputs == (*columns, "command_left", "command_right")
    assert body.targets == ("forward", "left", "turn", *columns)
    assert body.pixels(32) == 0 and body.weights == "variance"
    expected = (1e-4, 1e-3, 1e-4, pytest.approx(0.0349066), 1e-3, 1e-3)
    assert body.resolutions == expected
    digits = {"resolution": (("wz", 0.1 / 3),), "rate": 20 / 3, "map_size": 14 / 3}
    for one in (body, dataclasses.replace(ROVER, **digits)):
        assert body_from_mapping(body_to_mapping(one), "") == one


@pytest.mark.parametrize(
    "text, words",
    [
        (WARTHOG.replace("columns", "colums"), "did you mean 'columns'"),
        (WARTHOG.replace("wheel_left: rad/s", "wheel_left: "), "has no unit"),
        (WARTHOG.replace("actions", "#"), "it has no actions"),
        (WARTHOG.replace("command_left", "wheel_left"), "two columns 'wheel_left'"),
        (WARTHOG.replace("yaw_rate", "yaw rate"), "letters, digits and _"),
        (WARTHOG.replace("10 Hz", "0"), "rate must be positive"),
        (WARTHOG + "tilt: true\n", "tilt is seen in a spatial pose alone"),
        (WARTHOG + "map: 5 m\n", "map is 'none' or"),
        (WARTHOG + "map: {size: 0 m, pixels: 16}\n", "a map of 16 pixels on 0 m"),
        ("actions: {u: 1}\npose: none\n", "nothing to predict"),
        (
            "actions: {u: 1}\npose: none\ncolumns: {v: m/s}\nmap: {size: 5 m}\n",
            "a height map needs a pose",
        ),
        (WARTHOG + "resolution: {lef: 1 mm}\n", "did you mean 'left'?"),
        (WARTHOG + "resolution: {left: 1}\n", "'left' is a number in m or cm or mm"),
        (WARTHOG + "resolution: {left: -1 mm}\n", "must be from 0 to 1e+12"),
        (WARTHOG + "rate: 20 Hz\n", "line 6: 'rate' is given twice; leave one out"),
        ("a: [", "no YAML"),
        (None, "there is no such file"),
    ],
)
def test_a_fault_is_one_line_that_names_file_and_fault(tmp_path, text, words):
    path = tmp_path / "robot.yaml"
    if text is not None:
        path.write_text(text)
    with pytest.raises(ConfigError) as error:
        read_body(path)
    assert words in str(error.value)
    assert str(error.value).startswith(str(path))
    assert "\n" not in str(error.value)


def test_an_unknown_unit_stays_as_it_is():
    body = Body(
        name="cart",
        pose="none",
        columns=(("wheel", "rpm"), ("odour", "ou/m3")),
        actions=(("throttle", "%"),),
    )
    assert [SI[unit] for _, unit in body.columns] == ["rad/s", "ou/m3"]
    assert units_like("ou/m3") == {"ou/m3": 1.0}
    assert units_like("rad/s")["rpm"] == pytest.approx(0.10471976)
    assert body.unknown_units == {"odour": "ou/m3"}
    assert body.resolutions == (1e-3, 0)
