"""Films of a drive, by Bullet's software renderer."""

from __future__ import annotations

import io
from typing import Any

import numpy as np
from PIL import Image

from sidm.simulation.simulator import Simulator


def film(simulator: Simulator, actions: np.ndarray, **view: Any) -> np.ndarray:
    """Drive on through actions (T, 2) and take a picture after each: (T, height, width, 3) uint8.

    Args:
        simulator: made with `visible=True`.
        actions: one a control step.
        view: arguments of `Simulator.picture`; the camera follows the robot.
    """
    frames = []
    for action in actions:
        simulator.step(action)
        frames.append(simulator.picture(**view))
    return np.array(frames)


def gif(frames: np.ndarray, seconds: float = 0.1) -> bytes:
    """Frames (T, height, width, 3) uint8 as an animated GIF that shows each for `seconds` and repeats."""
    # keep rare colours, and the file small
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
