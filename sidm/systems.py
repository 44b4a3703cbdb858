"""The robots, their terrain and the physics they live in: the paper's two systems as frozen dataclasses.

The values are those of the authors' released simulation parameters (footnote 1 of the
paper); the ratios between novice and expert are the paper's (section 5).

Examples:
    >>> sidm.SYSTEMS["system1"].novice.spring  # N/m
    50000.0
"""

from __future__ import annotations

import dataclasses
import math

from sidm.config import ConfigError, config, refuse_nonsense


@config
class Robot:
    """What distinguishes one robot from another; what is the same for all is in `simulation.dimensions`.

    Attributes:
        throttle_scale: wheel speed at full throttle, rad/s
        steering_scale: kingpin angle at full steering, rad
        spring_offset: the spring's rest position on the strut's travel, m, compression
            positive
        travel_lower: the strut's longest extension, m (negative)
        travel_upper: the strut's deepest compression, m
        damping: of each strut, N s/m
        spring: stiffness of each strut, N/m
        friction: Coulomb coefficient of the tyres
        mass_scale: on mass and inertia of every part but the chassis

    Raises:
        ConfigError: an unknown name, a wrong type, or values that make no robot.

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
        refuse_nonsense(self)
        if not self.travel_lower < self.travel_upper:
            raise ConfigError(
                f"Robot.travel_lower must be below travel_upper, not {self.travel_lower} and {self.travel_upper}"
            )
        for name in ("damping", "spring", "friction", "mass_scale"):
            if getattr(self, name) < 0 or (
                name == "mass_scale" and self.mass_scale == 0
            ):
                raise ConfigError(
                    f"Robot.{name} must be positive, not {getattr(self, name)}"
                )

    def replace(self, **changes: float) -> Robot:
        """The same robot with some values changed, checked like a new one."""
        return Robot(**(dataclasses.asdict(self) | changes))


GRID_SPACING = 0.1  # m, of the ground's heights in the simulator


@config
class Terrain:
    """Random rocky ground: Voronoi steps of random height, smoothed, with finer noise and a flat start (section 5).

    Attributes:
        cell_height_scale: amplitude of the cells' Perlin heights, m
        size: grid points a side
        spacing: between grid points, m
        cells_per_area: mean density of cell centres, 1/m^2
        cell_frequency: of the Perlin noise that gives the cells' heights, 1/m
        start_cell_radius: centres nearer to the origin than this are replaced by one at
            the origin, m
        smoothing: standard deviation of the Gaussian filter, grid cells
        noise_height_scale: amplitude of the fine Perlin noise, m
        noise_frequency: of the fine Perlin noise, 1/m
        flat_radius: of the level disc at the origin, m
        blend: width of the ring around the disc that leads back to the rough ground, m

    Raises:
        ConfigError: an unknown name, a wrong type, or a spacing that the simulator does
            not have.

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
        refuse_nonsense(self)
        if self.spacing != GRID_SPACING:
            raise ConfigError(
                f"Terrain.spacing must be {GRID_SPACING}, as in the simulator, not {self.spacing}"
            )

    @property
    def half_width(self) -> float:
        """Distance from the origin to the border, m."""
        return (self.size - 1) * self.spacing / 2


@config
class Physics:
    """Constants of the rigid-body simulation, shared by all robots: the released simulator's, but for the solver's.

    Changed one at a time against trajectories of the released mechanism: twice the
    `time_step` makes stiff struts and contacts another robot altogether, a tenth of the
    `contact_damping` lets it bounce and part about four times as far, a fifth of the
    `damping` (Bullet's drag) about twice as far. A third of the `contact_stiffness`, a
    tenth of the `contact_margin`, no `contact_slop`, 10 `solver_iterations` or 100 are
    hardly seen.

    `kingpin_stop` and `strut_motors` are in no table of the released robot: its
    recorded motion shows them. At full steering every robot turns as with 0.5 rad, and
    its struts move as if braked (`sidm.simulation.suspension`).
    """

    time_step: float = 1 / 500  # s
    steps_per_control: int = 50  # physics steps in one control step of 0.1 s
    gravity: float = 10.0  # m/s^2, downward
    solver_iterations: int = 50  # at most, of the constraint solver, a physics step
    #: squared velocity error at which the solver stops earlier; saves 4 % of the time
    solver_residual: float = 1e-4
    damping: float = 0.2  # linear and angular drag of every link, as Bullet defines it
    contact_threshold: float = 1e-4  # breaking threshold of contacts, m
    contact_slop: float = 1e-4  # penetration that the solver leaves alone, m
    contact_margin: float = 0.01  # collision margin around the terrain, m
    contact_stiffness: float = 30_000.0  # of the terrain, N/m
    contact_damping: float = 1_000.0  # of the terrain, N s/m
    #: Coulomb coefficient of the terrain; Bullet multiplies it with the tyre's
    ground_friction: float = 0.5
    wheel_torque: float = 10.0  # at most, a wheel, N m
    steering_rate: float = 10.0  # at most, a kingpin, rad/s
    #: whatever the steering scale, the front wheels turn no farther, rad
    kingpin_stop: float = 0.5
    #: the struts braked as in the released simulator; without, see FREE_PHYSICS
    strut_motors: bool = True
    #: of the body's origin above the highest ground within 1 m at the start, m
    drop_height: float = 0.3
    settling_time: float = 0.5  # before a trajectory begins, s

    def __post_init__(self) -> None:
        """Refuse what is no number."""
        refuse_nonsense(self)


@config
class System:
    """A pair of similar robots and the ground they drive on.

    Attributes:
        novice: the target, whose data are dear
        expert: the proxy, whose data are cheap

    Raises:
        ConfigError: an unknown name or a wrong type.

    Examples:
        >>> pair = sidm.SYSTEMS["system2"]
        >>> own = sidm.System(name="own", novice=pair.expert, expert=pair.novice, terrain=pair.terrain)
        >>> own.robot("novice") == pair.expert
        True
    """

    name: str
    novice: Robot
    expert: Robot
    terrain: Terrain
    physics: Physics = Physics()

    def robot(self, role: str) -> Robot:
        """The robot in the role 'novice' or 'expert'; ConfigError for another."""
        if role not in ROLES:
            raise ConfigError(f"a role is one of {', '.join(ROLES)}, not {role!r}")
        return self.novice if role == "novice" else self.expert


ROLES = ("novice", "expert")

SYSTEMS = {
    "system1": System(  # similar dynamics: spring 5 x, damping 2 x, equal travel
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
    # unlike dynamics: spring 667 x, damping 100 x, 1.5 x less travel
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

#: ends the names of the systems whose struts no motor brakes
FREE_STRUTS = "_free_struts"

#: Of robots whose struts no motor brakes. A chassis on stiff springs rings in steps of
#: 2 ms, by 20 rad/s and more in pitch; in steps of 1 ms its velocities peak no higher
#: than in steps of 0.5 ms.
FREE_PHYSICS = Physics(time_step=1 / 1000, steps_per_control=100, strut_motors=False)

# The same robots as the paper describes them, springs and dampers alone; of the presets
# that name them.
FREE_SYSTEMS = {
    name + FREE_STRUTS: System(
        name=name + FREE_STRUTS,
        novice=system.novice,
        expert=system.expert,
        terrain=system.terrain,
        physics=FREE_PHYSICS,
    )
    for name, system in SYSTEMS.items()
}

FAMILY_SEED = 5  # of the robots drawn

# Ranges that hold the paper's four robots, drawn from evenly in the logarithm or, where
# they reach 0, in the number.
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


def member(number: int) -> Robot:
    """Robot `number` of the family."""
    import numpy as np  # which listing trials does without

    rng = np.random.default_rng(
        np.random.SeedSequence(FAMILY_SEED, spawn_key=(number,))
    )
    values = {
        name: math.exp(rng.uniform(math.log(low), math.log(high)))
        for name, (low, high) in LOGARITHMIC.items()
    }
    values |= {name: rng.uniform(low, high) for name, (low, high) in LINEAR.items()}
    return Robot(**{name: float(f"{value:.4g}") for name, value in values.items()})


# Pairs of the family that nothing was tuned on: numbers of novice and expert, and whose
# ground they drive on.
FAMILY_PAIRS = {"family20_21": (20, 21, "system1"), "family22_23": (22, 23, "system2")}


def is_known(name: str) -> bool:
    """Whether `find_system` finds a system of that name."""
    return name in SYSTEMS or name in FREE_SYSTEMS or name in FAMILY_PAIRS


def find_system(name: str) -> System:
    """The system of that name; ConfigError naming the known ones otherwise."""
    if name in FAMILY_PAIRS:
        novice, expert, ground = FAMILY_PAIRS[name]
        paper = SYSTEMS[ground]
        return System(
            name=name,
            novice=member(novice),
            expert=member(expert),
            terrain=paper.terrain,
        )
    known = SYSTEMS | FREE_SYSTEMS
    if name not in known:
        raise ConfigError(
            f"unknown system '{name}'; known: {', '.join((*known, *FAMILY_PAIRS))}"
        )
    return known[name]
