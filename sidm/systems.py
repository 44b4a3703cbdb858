"""Robots, terrain and physics: the paper's two systems as frozen dataclasses.

The values are those of the authors' released simulation parameters (footnote 1 of the
paper); the ratios between novice and expert are the paper's (section 5).

Examples:
    >>> sidm.SYSTEMS["system1"].novice.spring  # N/m
    50000.0
"""

from __future__ import annotations

import dataclasses
import math
from typing import Any

from sidm.config import ConfigError, check_at_least, check_numbers, config, replace


@config
class Robot:
    """Values in which robots differ; `simulation.dimensions` has what all share.

    Attributes:
        throttle_scale: wheel speed at full throttle, rad/s
        steering_scale: kingpin angle at full steering, rad
        spring_offset: the spring's rest position on the strut's travel, m, compression
            positive
        travel_lower: the strut's longest extension, m (negative)
        travel_upper: the strut's deepest compression, m
        damping: damping of each strut, N s/m
        spring: stiffness of each strut, N/m
        friction: Coulomb coefficient of the tyres
        mass_scale: factor on mass and inertia of every part but the chassis

    Examples:
        >>> soft = sidm.SYSTEMS["system1"].novice.replace(spring=500.0)
        >>> soft.spring, soft.damping
        (500.0, 100.0)
    """

    throttle_scale: float
    steering_scale: float
    spring_offset: float
    travel_lower: float
    travel_upper: float
    damping: float
    spring: float
    friction: float
    mass_scale: float = 1.0

    def __post_init__(self) -> None:
        """Refuse a robot that cannot be built."""
        check_numbers(self)
        if not self.travel_lower < self.travel_upper:
            raise ConfigError(
                "Robot.travel_lower must be below travel_upper, "
                f"not {self.travel_lower} and {self.travel_upper}"
            )
        for name in ("damping", "spring", "friction", "mass_scale"):
            value = getattr(self, name)
            if value < 0 or (name == "mass_scale" and value == 0):
                raise ConfigError(f"Robot.{name} must be positive, not {value}")

    def replace(self, **changes: float) -> Robot:
        """A copy of the robot with changed values, checked like a new one."""
        return replace(self, **changes)


CONTROL_STEP = 0.1  # s
GRID_SPACING = 0.1  # m between the heights of the ground in the simulator
LEAST_SIZE = 41  # grid points along a side: 2 m to every side of the start


@config
class Terrain:
    """Random rocky ground (section 5): smoothed Voronoi steps, noise and a flat start.

    Attributes:
        cell_height_scale: amplitude of the cells' Perlin heights, m
        size: grid points along a side
        spacing: distance between grid points, m
        cells_per_area: mean density of cell centres, 1/m^2
        cell_frequency: frequency of the Perlin noise for the cells' heights, 1/m
        start_cell_radius: centres nearer to the origin than this are replaced by one at
            the origin, m
        smoothing: standard deviation of the Gaussian filter, grid cells
        noise_height_scale: amplitude of the fine Perlin noise, m
        noise_frequency: frequency of the fine Perlin noise, 1/m
        flat_radius: radius of the level disc at the origin, m
        blend: width of the ring around the disc that leads back to the rough ground, m

    Examples:
        >>> sidm.Terrain(cell_height_scale=0.4).half_width  # m
        14.95...
    """

    cell_height_scale: float
    size: int = 300
    spacing: float = GRID_SPACING
    cells_per_area: float = 1.0
    cell_frequency: float = 5.0
    start_cell_radius: float = 2.0
    smoothing: float = 0.7
    noise_height_scale: float = 0.1
    noise_frequency: float = 2.5
    flat_radius: float = 1.0
    blend: float = 0.5

    def __post_init__(self) -> None:
        """Refuse ground that cannot be built."""
        check_numbers(self)
        check_at_least(self, 0, "cells_per_area", "smoothing")
        check_at_least(self, LEAST_SIZE, "size")
        check_at_least(self, self.spacing, "flat_radius", "blend")
        if self.spacing != GRID_SPACING:
            raise ConfigError(
                f"Terrain.spacing must be {GRID_SPACING}, as in the simulator, "
                f"not {self.spacing}"
            )

    @property
    def half_width(self) -> float:
        """Distance from the origin to the border, m."""
        return (self.size - 1) * self.spacing / 2


@config
class Physics:
    """Constants of the rigid-body simulation, which all robots share.

    All but the solver's are the released simulator's. Each was changed by itself, and
    the motion was compared with trajectories of the released mechanism. Twice the
    `time_step` turns stiff struts and contacts into another robot. With a tenth of the
    `contact_damping` the robot bounces, and its motion differs about four times as
    much; with a fifth of the `damping` (Bullet's drag) it differs about twice as much.
    A third of the `contact_stiffness`, a tenth of the `contact_margin`, no
    `contact_slop` and 10 or 100 `solver_iterations` have hardly any effect.

    `kingpin_stop` and `strut_motors` are in no table of the released robot: its
    recorded motion shows them. At full steering every robot turns as with 0.5 rad, and
    its struts move as if braked (`sidm.simulation.suspension`).
    """

    time_step: float = 1 / 500  # physics step, s
    steps_per_control: int = 50  # physics steps in one control step of 0.1 s
    gravity: float = 10.0  # m/s^2, downward
    solver_iterations: int = 50  # of the constraint solver in a physics step, at most
    #: squared velocity error at which the solver stops earlier: saves 4 % of the time
    solver_residual: float = 1e-4
    damping: float = 0.2  # linear and angular drag of every link, as Bullet defines it
    contact_threshold: float = 1e-4  # breaking threshold of contacts, m
    contact_slop: float = 1e-4  # penetration that the solver does not correct, m
    contact_margin: float = 0.01  # collision margin around the terrain, m
    contact_stiffness: float = 30_000.0  # stiffness of the terrain, N/m
    contact_damping: float = 1_000.0  # damping of the terrain, N s/m
    #: Coulomb coefficient of the terrain; Bullet multiplies it by the tyre's
    ground_friction: float = 0.5
    wheel_torque: float = 10.0  # torque at a wheel, at most, N m
    steering_rate: float = 10.0  # angular velocity of a kingpin, at most, rad/s
    #: angle of the front wheels, at most, whatever the steering scale, rad
    kingpin_stop: float = 0.5
    #: whether motors brake the struts, as in the released simulator; see FREE_PHYSICS
    strut_motors: bool = True
    #: height of the body's origin at the start, above the highest ground within 1 m, m
    drop_height: float = 0.3
    settling_time: float = 0.5  # time before a trajectory begins, s

    def __post_init__(self) -> None:
        """Refuse numbers that are not finite."""
        check_numbers(self)


@config
class System:
    """A pair of similar robots and the ground that they drive on.

    Attributes:
        name: for messages, and for the folder of the system's trajectories
        novice: the target robot, whose data are expensive
        expert: the proxy robot, whose data are cheap
        terrain: the kind of ground
        physics: constants of the simulation

    Examples:
        >>> pair = sidm.SYSTEMS["system2"]
        >>> swapped = pair.replace(
        ...     name="swapped", novice=pair.expert, expert=pair.novice
        ... )
        >>> swapped.robot("novice") == pair.expert
        True
    """

    name: str
    novice: Robot
    expert: Robot
    terrain: Terrain
    physics: Physics = dataclasses.field(default_factory=Physics)

    def __post_init__(self) -> None:
        """Refuse a name that no folder can have, and steps of another length."""
        if not self.name.isidentifier():
            raise ConfigError(f"System.name must be a plain name, not {self.name!r}")
        step = self.physics.time_step * self.physics.steps_per_control
        if not math.isclose(step, CONTROL_STEP):
            raise ConfigError(
                "System.physics: time_step times steps_per_control must be "
                f"{CONTROL_STEP} s, a control step, not {step:.4g}"
            )

    def replace(self, **changes: Any) -> System:
        """A copy of the system with changed values, checked like a new one."""
        return replace(self, **changes)

    def robot(self, role: str) -> Robot:
        """The robot in a role; ConfigError if it is not 'novice' or 'expert'."""
        if role not in ROLES:
            raise ConfigError(f"a role is one of {', '.join(ROLES)}, not {role!r}")
        return self.novice if role == "novice" else self.expert


ROLES = ("novice", "expert")

#: Pairs of robots by name; one of your own belongs here, too.
SYSTEMS = {
    # Similar dynamics: the novice has 5 times the spring, twice the damping and the
    # same travel.
    "system1": System(
        name="system1",
        novice=Robot(
            throttle_scale=30.0,
            steering_scale=0.5,
            spring_offset=-0.001,
            travel_lower=-0.02,
            travel_upper=0.0,
            damping=100.0,
            spring=50_000.0,
            friction=1.25,
        ),
        expert=Robot(
            throttle_scale=60.0,
            steering_scale=0.8,
            spring_offset=-0.002,
            travel_lower=-0.02,
            travel_upper=0.0,
            damping=50.0,
            spring=10_000.0,
            friction=1.0,
            mass_scale=1.5,
        ),
        terrain=Terrain(cell_height_scale=0.35),
    ),
    # Different dynamics: 667 times the spring, 100 times the damping, 1.5 times less
    # travel.
    "system2": System(
        name="system2",
        novice=Robot(
            throttle_scale=30.0,
            steering_scale=0.5,
            spring_offset=0.0,
            travel_lower=-0.01,
            travel_upper=0.003,
            damping=100.0,
            spring=50_000.0,
            friction=1.0,
        ),
        expert=Robot(
            throttle_scale=40.0,
            steering_scale=0.75,
            spring_offset=-0.002,
            travel_lower=-0.02,
            travel_upper=0.0,
            damping=1.0,
            spring=75.0,
            friction=1.25,
            mass_scale=1.5,
        ),
        terrain=Terrain(cell_height_scale=0.9),
    ),
}

#: End of the names of systems whose struts no motor brakes.
FREE_STRUTS = "_free_struts"

#: Physics of robots whose struts no motor brakes. With a physics step of 2 ms a chassis
#: on stiff springs oscillates by 20 rad/s and more in pitch; with 1 ms its velocities
#: peak no higher than with 0.5 ms.
FREE_PHYSICS = Physics(time_step=1 / 1000, steps_per_control=100, strut_motors=False)

#: The pairs whose results the book shows.
PAPER_SYSTEMS = ("system1", "system2")

#: The paper's systems as its text describes them, with springs and dampers alone. Only
#: some presets use them.
FREE_SYSTEMS = {
    name + FREE_STRUTS: SYSTEMS[name].replace(
        name=name + FREE_STRUTS, physics=FREE_PHYSICS
    )
    for name in PAPER_SYSTEMS
}

FAMILY_SEED = 5  # seed of the family's random values

# Ranges of the family's values, which include the paper's four robots. A value is drawn
# uniformly in its logarithm, or in the number itself where the range reaches 0.
LOGARITHMIC = {
    "throttle_scale": (30.0, 60.0),
    "steering_scale": (0.5, 0.8),
    "damping": (1.0, 100.0),
    "spring": (75.0, 50_000.0),
    "friction": (1.0, 1.25),
    "mass_scale": (1.0, 1.5),
}
LINEAR = {
    "spring_offset": (-0.002, 0.0),
    "travel_lower": (-0.02, -0.01),
    "travel_upper": (0.0, 0.003),
}


def family_robot(number: int) -> Robot:
    """Robot `number` of a family of random robots like the paper's."""
    import numpy as np  # here, since commands that only list trials need no NumPy

    seeds = np.random.SeedSequence(FAMILY_SEED, spawn_key=(number,))
    rng = np.random.default_rng(seeds)
    values = {
        name: math.exp(rng.uniform(math.log(low), math.log(high)))
        for name, (low, high) in LOGARITHMIC.items()
    }
    values |= {name: rng.uniform(low, high) for name, (low, high) in LINEAR.items()}
    return Robot(**{name: float(f"{value:.4g}") for name, value in values.items()})


# Pairs of the family on which nothing was tuned: numbers of novice and expert, and the
# system whose ground they drive on.
FAMILY_PAIRS = {"family20_21": (20, 21, "system1"), "family22_23": (22, 23, "system2")}


def is_system(name: str) -> bool:
    """Whether `find_system` finds a system of that name."""
    return name in SYSTEMS or name in FREE_SYSTEMS or name in FAMILY_PAIRS


def find_system(name: str) -> System:
    """The system of that name; ConfigError, which lists the known names, for others."""
    if name in FAMILY_PAIRS:
        novice, expert, ground = FAMILY_PAIRS[name]
        return SYSTEMS[ground].replace(
            name=name, novice=family_robot(novice), expert=family_robot(expert)
        )
    known = SYSTEMS | FREE_SYSTEMS
    if name not in known:
        raise ConfigError(
            f"unknown system '{name}'; known: {', '.join((*known, *FAMILY_PAIRS))}"
        )
    return known[name]
