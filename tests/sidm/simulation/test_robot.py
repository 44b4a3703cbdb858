"""The robot's model as Bullet reads it: masses, names of joints, places of wheels."""

import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest

from sidm.simulation import Simulator
from sidm.simulation.dimensions import AXLES, REAR_LEFT_TYRE, SIDES, mirror
from sidm.simulation.robot import HEAVES, KINGPINS, ROLLS, WHEELS, urdf
from sidm.simulation.suspension import Suspension
from sidm.systems import SYSTEMS, Physics

ROBOTS = SYSTEMS["system1"]


def model(robot):
    return urdf(robot, {axle: Suspension(robot, axle, Physics()) for axle in AXLES})


@pytest.mark.parametrize(
    ("robot", "total"), [(ROBOTS.novice, 13.0), (ROBOTS.expert, 1.20456 + 1.5 * 11.79)]
)
def test_masses_add_up(robot, total):
    tree = ElementTree.fromstring(model(robot))
    masses = [float(mass.get("value")) for mass in tree.iter("mass")]
    assert sum(masses) == pytest.approx(total, rel=0.01)
    assert {joint.get("name") for joint in tree.iter("joint")} >= {
        *HEAVES,
        *ROLLS,
        *WHEELS,
        *KINGPINS,
    }


def test_lines_are_short_enough_for_bullets_reader():
    assert max(map(len, model(ROBOTS.novice).splitlines())) < 1000


@pytest.mark.parametrize("motors", [True, False])
def test_with_struts_at_zero_the_tyres_are_where_the_figures_have_them(motors):
    with Simulator(
        ROBOTS.expert, np.zeros((300, 300)), Physics(strut_motors=motors)
    ) as simulator:
        client, body = simulator._client, simulator._body
        states = client.getLinkStates(
            body, simulator._wheels, computeForwardKinematics=1
        )
        assert simulator.strut_positions == pytest.approx(np.zeros(4), abs=1e-6)
    expected = [mirror(axle, side) * REAR_LEFT_TYRE for axle in AXLES for side in SIDES]
    assert np.array([state[4] for state in states]) == pytest.approx(
        np.array(expected), abs=1e-3
    )  # exact at mid-travel
