"""Figures and the table of the chapter on the robots."""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from companion.figures.style import system_label
from companion.pages.markdown import markdown_table
from sidm.systems import ROLES, System
from sidm.terrain import generate_terrain

#: Field of a robot -> what it is, with its unit.
FIELDS = {
    "throttle_scale": "wheel speed at full throttle (rad/s)",
    "steering_scale": "wheel angle at full steering (rad)",
    "spring_offset": "rest of the spring, compression positive (m)",
    "travel_lower": "longest extension (m)",
    "travel_upper": "deepest compression (m)",
    "damping": "damping (N s/m)",
    "spring": "spring (N/m)",
    "friction": "friction of the tyres (-)",
    "mass_scale": "factor on all masses but the chassis's (-)",
}
START_YAW = 0.5  # rad
STEERING = 0.2  # of full steering


def robots_figure(
    pairs: Sequence[System], terrain_seed: int, throttle: float, steps: int
) -> Figure:
    """Pictures of both robots of each pair after a short drive on their own ground."""
    from sidm.simulation import Simulator  # PyBullet, which the rest does without

    figure = plt.figure(figsize=(9.6, 3.5 * len(pairs)), layout="constrained")
    panels = iter(figure.subplots(len(pairs), 2).flat)
    for pair in pairs:
        heights = generate_terrain(pair.terrain, terrain_seed)
        for role, panel in zip(ROLES, panels, strict=False):
            robot = pair.robot(role)
            with Simulator(robot, heights, pair.physics, visible=True) as simulator:
                simulator.reset(0.0, 0.0, START_YAW)
                for _ in range(steps):
                    simulator.step(np.array([throttle, STEERING]))
                panel.imshow(simulator.picture(distance=1.2))
            name = f"{system_label(pair.name)}, {role}"
            title = f"{name}: springs of {robot.spring:,.0f} N/m"
            panel.set(xticks=[], yticks=[])
            panel.set_title(title, color="0.46")  # is read on white and on black
    figure.set_facecolor("none")
    plt.close(figure)
    return figure


def robots_table(pairs: Sequence[System]) -> str:
    """The values in which the robots of pairs differ, as a table in Markdown."""
    robots = {
        f"{system_label(pair.name)} {role}": pair.robot(role)
        for pair in pairs
        for role in ROLES
    }
    rows = [
        (
            f"{what}, `{field}`",
            *(f"{getattr(one, field):,g}" for one in robots.values()),
        )
        for field, what in FIELDS.items()
    ]
    return markdown_table(["", *robots], rows)


def grounds_figure(pairs: Sequence[System], terrain_seed: int) -> Figure:
    """The ground of each pair from above, in one scale of colours."""
    grounds = [generate_terrain(pair.terrain, terrain_seed) for pair in pairs]
    figure = plt.figure(figsize=(4.8 * len(pairs), 4.2), layout="constrained")
    axes = figure.subplots(1, len(pairs), squeeze=False)[0]
    highest = max(float(heights.max()) for heights in grounds)
    for panel, pair, heights in zip(axes, pairs, grounds, strict=True):
        half = pair.terrain.half_width
        picture = panel.imshow(
            heights,
            origin="lower",
            extent=(-half, half, -half, half),
            cmap="cividis",
            vmin=0,
            vmax=highest,
        )
        panel.grid(False)
        panel.set(title=system_label(pair.name), xlabel="x (m)", ylabel="y (m)")
    figure.colorbar(picture, ax=list(axes), label="height (m)", shrink=0.8)
    plt.close(figure)
    return figure
