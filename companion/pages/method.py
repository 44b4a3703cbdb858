"""Figures and tables of the chapter on the method."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
import torch
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from torch import Tensor, nn

from companion.figures.style import LOSS_LABEL, METHOD_STYLES
from companion.pages.markdown import markdown_table, table_markdown
from companion.statistics.tables import COMPONENTS
from ownrobot.plots import WIDTH, styled
from sidm import rotations
from sidm.body import ROVER
from sidm.drives import CONTROL_STEP, POSITION, QUATERNION, STEPS
from sidm.learning import (
    SIDM,
    Datasets,
    Decoder,
    Discriminator,
    Encoder,
    parameter_count,
    robot_centred_map,
    validation_loss,
)
from sidm.learning.trainer import Trainer
from sidm.learning.training import (
    Trained,
    discriminator_iteration,
    matching_iteration,
    prediction_phase,
)
from sidm.settings import Network
from sidm.systems import GRID_SPACING, System
from sidm.terrain import generate_terrain, height_at

SAMPLES = "samples seen (1,000 steps)"
CANNOT_TELL = 0.5  # accuracy of a discriminator that the latents tell nothing
SPEED, TURN = 1.0, 0.5  # m/s and rad/s, of a drive in a circle


@styled
def training_figure(trained: Mapping[str, Trained]) -> Figure:
    """Losses of trainings, one of them `sidm`, and the discriminator's accuracy."""
    figure, (left, right) = plt.subplots(
        1, 2, figsize=(WIDTH, 4.0), layout="constrained", width_ratios=(5, 4)
    )
    for method, run in trained.items():
        _draw_losses(left, METHOD_STYLES[method], run)
    left.set(xlabel=SAMPLES, ylim=0, title="loss on training and test data")
    left.set_ylabel(LOSS_LABEL)
    tests = [t for t in trained["sidm"].history if t.discriminator_accuracy is not None]
    accuracy = [test.discriminator_accuracy for test in tests]
    colour = METHOD_STYLES["sidm"]["color"]
    right.plot([t.samples / 1000 for t in tests], accuracy, color=colour, marker="")
    right.axhline(CANNOT_TELL, color="0.5", linestyle="-", marker="", lw=1)
    right.annotate(
        "cannot tell: the aim",
        (0.98, CANNOT_TELL),
        (0, -14),
        xycoords=right.get_yaxis_transform(),
        textcoords="offset points",
        ha="right",
    )
    right.set(xlabel=SAMPLES, ylim=(0, 1.05), xlim=left.get_xlim())
    right.set(ylabel="discriminator's accuracy (-)", title="are the robots told apart?")
    lines = left.get_legend_handles_labels()
    figure.legend(*lines, loc="outside lower center", ncols=2)
    return figure


def _draw_losses(axes: Axes, style: Mapping[str, Any], run: Trained) -> None:
    """Draw the losses of one training, and a dot at the weights that are kept."""
    colour, label = style["color"], style["label"]
    samples = [test.samples / 1000 for test in run.history]
    tested = [test.test_loss for test in run.history]
    learnt = [test.training_loss for test in run.history]
    for losses, name, line in ((tested, "test", "-"), (learnt, "train", ":")):
        look = {"color": colour, "linestyle": line, "marker": ""}
        axes.plot(samples, losses, label=f"{label}, {name}", **look)
    best = samples.index(run.best_samples / 1000)
    axes.plot(samples[best], tested[best], color=colour, marker="o", markersize=10)


def errors_table(trained: Mapping[str, Trained], datasets: Datasets) -> str:
    """Root mean squared error of each component on validation data, in Markdown.

    The last column is a model that always predicts the mean of its training data.
    """
    losses = {
        METHOD_STYLES[method]["label"]: validation_loss(run.model, datasets.validation)
        for method, run in trained.items()
    }
    mean = datasets.train.targets.mean((0, 1))
    squares = (datasets.validation.targets - mean).square()
    losses["always the mean"] = squares.mean((0, 1))
    table = pd.DataFrame(COMPONENTS, columns=["component", "unit"])
    exact = {name: loss.double() for name, loss in losses.items()}
    table = table.assign(**{name: loss.sqrt().tolist() for name, loss in exact.items()})
    sums = [float(loss.sum()) for loss in exact.values()]
    table.loc[len(table)] = ["**equation (1), sum of squares**", "", *sums]
    return table_markdown(table)


def circle(heights: np.ndarray) -> Tensor:
    """States (STEPS + 1, 13) of a body that slides in a circle without tilting."""
    yaw = (TURN * CONTROL_STEP * torch.arange(STEPS + 1)).double()
    x, y = SPEED / TURN * yaw.sin(), SPEED / TURN * (1 - yaw.cos())
    z = torch.from_numpy(height_at(heights, x.numpy(), y.numpy())) + 0.17
    states = torch.zeros(STEPS + 1, 13, dtype=torch.float64)
    states[..., POSITION] = torch.stack([x, y, z], dim=-1)
    states[..., QUATERNION] = rotations.from_yaw(yaw)
    states[..., 7], states[..., 12] = SPEED, TURN  # forward velocity, yaw rate
    return states


@styled
def map_figure(pair: System, terrain_seed: int, step: int, pixels: int) -> Figure:
    """A drive in a circle from above, and what the network sees at one of its steps.

    `pixels` are along a side of the height map.
    """
    heights = generate_terrain(pair.terrain, terrain_seed)
    states = circle(heights)
    figure, (left, right) = plt.subplots(
        1, 2, figsize=(WIDTH, 3.4), layout="constrained"
    )
    state, reach = states[step], ROVER.map_size / 2
    half = (len(heights) - 1) * GRID_SPACING / 2
    corners = [[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0], [-1, -1, 0]]
    square = reach * torch.tensor(corners, dtype=states.dtype)
    outline = state[:2] + rotations.rotate(state[QUATERNION], square)[:, :2]
    look: dict[str, Any] = {"origin": "lower", "cmap": "cividis"}
    look |= {"vmin": -0.5, "vmax": 0.2}
    robot: dict[str, Any] = {"color": "white", "markeredgecolor": "black"}
    robot |= {"markersize": 9, "linestyle": "", "marker": "o"}
    left.imshow(heights - float(state[2]), extent=(-half, half, -half, half), **look)
    left.plot(*states[:, :2].T, color="white", linestyle="-", marker="", label="path")
    left.plot(*outline.T, color="black", linestyle="-", marker="", label="what it sees")
    left.plot(state[0], state[1], label="robot", **robot)
    left.set(title="the ground, and a drive over it", xlabel="x (m)", ylabel="y (m)")
    left.set(xlim=(-4, 6), ylim=(-3, 7))
    left.legend(loc="upper left", facecolor="0.75", frameon=True, framealpha=1)
    view = robot_centred_map(heights, state, pixels)  # rows to the left
    picture = right.imshow(view, extent=(-reach, reach, -reach, reach), **look)
    right.plot(0, 0, **robot)
    right.set_title(f"what the network sees, {pixels} x {pixels}")
    right.set(xlabel="forward (m)", ylabel="left (m)")
    left.grid(False)
    right.grid(False)
    label = "height above the robot (m)"
    figure.colorbar(picture, ax=(left, right), label=label, shrink=0.8)
    return figure


def sizes_table(networks: Mapping[str, Network]) -> str:
    """Numbers of weights of networks by name, as a table in Markdown."""
    configs = networks.values()
    parts = {
        "one encoder": Encoder,
        "SIDM": SIDM,
        "one decoder": Decoder,
        "discriminator": Discriminator,
    }
    with torch.device("meta"):
        counts = {
            f"weights of {name}": [parameter_count(part(config)) for config in configs]
            for name, part in parts.items()
        }
        dense = [parameter_count(Encoder(config).dense[0]) for config in configs]
    encoders = counts["weights of one encoder"]
    shares = [f"{a / b:.2%}" for a, b in zip(dense, encoders, strict=True)]
    lines = [
        ["height map", *(f"{config.pixels} x {config.pixels}" for config in configs)],
        ["LSTM layers", *(f"{config.layers} x {config.hidden}" for config in configs)],
        *([name, *(f"{count:,}" for count in row)] for name, row in counts.items()),
        ["share of encoder weights in its first dense layer", *shares],
    ]
    return markdown_table(["", *networks], lines)


def changed_weights(trainer: Trainer) -> str:
    """Which weights each step of Algorithms 1 and 2 changes, as a table in Markdown."""
    model = trainer.model
    parts: dict[str, nn.Module] = {
        "$E_n$": model.encoders["novice"],
        "$E_e$": model.encoders["expert"],
        "SIDM": model.sidm,
        "$D_n$": model.decoders["novice"],
        "$D_e$": model.decoders["expert"],
        "$A$": trainer.discriminator,
    }
    steps: dict[str, Any] = {
        "Algorithm 1": prediction_phase,
        "Algorithm 2, discriminator": discriminator_iteration,
        "Algorithm 2, matching": matching_iteration,
    }
    lines = []
    for name, iterate in steps.items():
        before = [_weights(part) for part in parts.values()]
        iterate(trainer)
        after = [_weights(part) for part in parts.values()]
        same = (torch.equal(*weights) for weights in zip(before, after, strict=True))
        lines.append([name, *("-" if equal else "changed" for equal in same)])
    return markdown_table(["", *parts], lines)


def _weights(part: nn.Module) -> Tensor:
    return torch.cat([weights.detach().flatten() for weights in part.parameters()])
