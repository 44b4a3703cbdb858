"""Make the moving picture of the book's first page: the paper's four robots drive.

`python book/moving_picture.py` makes book/static/robots.webp, drawn by the replay, and
robots-still.webp for readers who prefer no motion.
"""

from __future__ import annotations

import base64
import functools
import io
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from browser import chromium
from PIL import Image
from playwright.sync_api import sync_playwright

from ownrobot.replay import ROBOTS, Scene, View, weave
from ownrobot.replay.rides import drive, sampled_physics
from ownrobot.replay.scene import SPACING, ride_track
from sidm.drives import Ground
from sidm.simulation import Simulator
from sidm.systems import Terrain
from sidm.terrain import generate_terrain

FOLDER = Path(__file__).parent / "static"
GROUND, SEED = Terrain(cell_height_scale=0.35), 3
WHEEL_SPEED = 13.0  # rad/s of all four robots, whose gearings differ
APART = 1.15  # m from robot to robot at the start
STEPS = 60  # control steps
COLOURS = ("#0072B2", "#D55E00", "#56B4E9", "#E69F00")
SIZE = (720, 405)  # px
FINER = 2  # the frames are drawn this many times as large as SIZE
RATE, SECONDS = 15, 4.4  # frames a second and length of the loop, s
FADE = 9  # number of frames in which the end fades into the beginning
BEGIN = 0.7  # s, time of the ride at which the loop begins
QUALITY = 68
DRAW = """([time, azimuth, size, finer]) => {
    const view = document.getElementById("replay").replay;
    if (view.renderer.getPixelRatio() !== finer) {
        view.renderer.setPixelRatio(finer);
        view.renderer.setSize(...size, false);
        view.renderer.shadowMap.type = 1;  // soft, and finer than while it plays
        view.sun.shadow.map.dispose();
        view.sun.shadow.map = null;
        view.sun.shadow.mapSize.setScalar(2048);
        view.scene.traverse(({ material }) => {
            if (material) material.needsUpdate = true;
        });
        Object.assign(view.camera, { elevation: 0.42, distance: 3.3 });
    }
    view.time = time;
    view.camera.azimuth = azimuth;
    view.draw();
    return view.renderer.domElement.toDataURL("image/png");
}"""


def scene() -> Scene:
    """Scene of the four robots that drive in curves beside each other."""
    heights, tracks = generate_terrain(GROUND, SEED), []
    for number, (name, robot) in enumerate(ROBOTS.items()):
        start = functools.partial(Simulator.reset, x=-1.0, y=APART * (1.5 - number))
        with Simulator(robot, heights, sampled_physics(True)) as simulator:
            # `drive` would start from the origin
            simulator.reset = functools.partial(start, simulator)  # type: ignore
            throttle = WHEEL_SPEED / robot.throttle_scale
            ride = drive(simulator, throttle, weave(STEPS), STEPS)
        tracks.append(ride_track(ride, name, COLOURS[number]))
    return Scene(tuple(tracks), Ground(heights, SPACING))


def frames(robots: Scene) -> list[Image.Image]:
    """The pictures of the loop, in order."""
    count = round(RATE * SECONDS)
    with sync_playwright() as play, tempfile.TemporaryDirectory() as folder:
        View(robots).write(Path(folder) / "page.html")
        browser = play.chromium.launch(
            executable_path=chromium(),
            args=["--use-angle=swiftshader", "--enable-unsafe-swiftshader"],
        )
        window = {"width": 1000, "height": 800}
        page = browser.new_page(viewport=window, reduced_motion="reduce")
        page.goto((Path(folder) / "page.html").as_uri())
        page.wait_for_selector("body[data-shown]", state="attached")
        drawn = [picture(page, number) for number in range(count + FADE)]
        browser.close()
    for number in range(FADE):
        share = (number + 1) / (FADE + 1)
        drawn[number] = Image.blend(drawn[count + number], drawn[number], share)
    return drawn[FADE:count] + drawn[:FADE]  # the first picture is not a blend


def picture(page: Any, number: int) -> Image.Image:
    """Picture of frame `number`; the camera swings slowly from side to side."""
    time = number / RATE
    azimuth = -0.75 + 0.3 * np.sin(2 * np.pi * time / SECONDS)
    address = page.evaluate(DRAW, [BEGIN + time, azimuth, SIZE, FINER])
    content = base64.b64decode(address.partition(",")[2])
    large = Image.open(io.BytesIO(content)).convert("RGB")
    return large.resize(SIZE, Image.Resampling.LANCZOS)


def main() -> int:
    """Write both files; return 1 if there is no browser, else 0."""
    if chromium() is None:
        message = "no Chromium found; install it (Debian's package 'chromium')"
        print(message, file=sys.stderr)
        return 1
    pictures = frames(scene())
    pictures[0].save(
        FOLDER / "robots.webp",
        save_all=True,
        append_images=pictures[1:],
        duration=round(1000 / RATE),  # ms
        loop=0,
        quality=QUALITY,
        method=6,
    )
    still = pictures[len(pictures) // 3]
    still.save(FOLDER / "robots-still.webp", quality=80, method=6)
    return 0


if __name__ == "__main__":
    sys.exit(main())
