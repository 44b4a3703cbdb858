"""Films of a simulated drive, drawn by Bullet's software renderer."""

from __future__ import annotations

import io
from typing import Any

import numpy as np
from PIL import Image

from sidm.simulation.simulator import Simulator


def film(simulator: Simulator, actions: np.ndarray, **view: Any) -> np.ndarray:
    """Drive a robot through some actions and take a picture after each of them.

    Args:
        simulator: made with `visible=True`; the drive starts from its present state.
        actions: (T, 2), one for each control step.
        view: arguments of `Simulator.picture`; the camera follows the robot.

    Returns:
        Pictures (T, height, width, 3), uint8.
    """
    frames = []
    for action in actions:
        simulator.step(action)
        frames.append(simulator.picture(**view))
    return np.array(frames)


def gif(frames: np.ndarray, seconds: float = 0.1) -> bytes:
    """An animated GIF that repeats frames (T, height, width, 3), uint8."""
    # this method keeps rare colours, and dithering would enlarge the file
    octree, plain = Image.Quantize.FASTOCTREE, Image.Dither.NONE
    images = [
        Image.fromarray(frame).quantize(64, octree, dither=plain) for frame in frames
    ]
    file = io.BytesIO()
    images[0].save(
        file,
        "gif",
        save_all=True,
        append_images=images[1:],
        duration=round(1000 * seconds),
        loop=0,
    )
    return file.getvalue()
