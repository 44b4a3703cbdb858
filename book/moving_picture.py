"""The first page's moving picture: the paper's four robots drive over the same ground, as the replay shows them.

`python book/moving_picture.py` makes book/static/robots.webp anew, and
robots-still.webp for who wants no motion.
"""

from __future__ import annotations

import base64
import io
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from pdf import chromium
from PIL import Image
from playwright.sync_api import sync_playwright

from sidm.drives import Ground
from sidm.replay import ROBOTS, Scene, View, weave
from sidm.replay.rides import drive, sampled_physics
from sidm.replay.scene import SPACING, ride_track
from sidm.simulation import Simulator
from sidm.systems import Terrain
from sidm.terrain import generate_terrain

FOLDER = Path(__file__).parent / "static"
GROUND, SEED = Terrain(cell_height_scale=0.35), 3
WHEEL_SPEED = 13.0  # rad/s of all four, which have other gearings
APART, STEPS = 1.15, 60  # m from robot to robot at the start, control steps
COLOURS = ("#0072B2", "#D55E00", "#56B4E9", "#E69F00")
SIZE, FINER = (720, 405), 2  # px; drawn so many times as large
#: frames a second, s, frames that the end takes over into the beginning, s
RATE, SECONDS, FADE, BEGIN = 15, 4.4, 9, 0.7
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
        view.scene.traverse(({ material }) => material && (material.needsUpdate = true));
        Object.assign(view.camera, { elevation: 0.42, distance: 3.3 });
    }
    view.time = time;
    view.camera.azimuth = azimuth;
    view.draw();
    return view.renderer.domElement.toDataURL("image/png");
}"""


def scene() -> Scene:
    """The four robots beside each other, weaving."""
    heights, tracks = generate_terrain(GROUND, SEED), []
    for number, (name, robot) in enumerate(ROBOTS.items()):
        with Simulator(robot, heights, sampled_physics(True)) as simulator:
            settle = simulator.reset
            simulator.reset = lambda y=APART * (1.5 - number), settle=settle: settle(
                -1.0, y
            )  # type: ignore[method-assign]
            ride = drive(
                simulator, WHEEL_SPEED / robot.throttle_scale, weave(STEPS), STEPS
            )
        tracks.append(ride_track(ride, name, COLOURS[number]))
    return Scene(tuple(tracks), Ground(heights, SPACING))


def frames(one: Scene) -> list[Image.Image]:
    """The pictures that follow each other in a loop."""
    count = round(RATE * SECONDS)
    with sync_playwright() as play, tempfile.TemporaryDirectory() as folder:
        View(one).write(Path(folder) / "page.html")
        browser = play.chromium.launch(
            executable_path=chromium(),
            args=["--use-angle=swiftshader", "--enable-unsafe-swiftshader"],
        )
        page = browser.new_page(
            viewport={"width": 1000, "height": 800}, reduced_motion="reduce"
        )
        page.goto((Path(folder) / "page.html").as_uri())
        page.wait_for_selector("body[data-shown]", state="attached")
        drawn = [picture(page, number) for number in range(count + FADE)]
        browser.close()
    for number in range(FADE):
        drawn[number] = Image.blend(
            drawn[count + number], drawn[number], (number + 1) / (FADE + 1)
        )
    return drawn[FADE:count] + drawn[:FADE]  # so that it begins with a clear one


def picture(page: Any, number: int) -> Image.Image:
    """Frame `number`; the camera swings slowly to and fro."""
    time = number / RATE
    azimuth = -0.75 + 0.3 * np.sin(2 * np.pi * time / SECONDS)
    content = page.evaluate(DRAW, [BEGIN + time, azimuth, SIZE, FINER]).partition(",")[
        2
    ]
    return (
        Image.open(io.BytesIO(base64.b64decode(content)))
        .convert("RGB")
        .resize(SIZE, Image.Resampling.LANCZOS)
    )


def main() -> int:
    """Write both files; 1 without a browser."""
    if chromium() is None:
        print(
            "no Chromium found; install it (Debian's package 'chromium')",
            file=sys.stderr,
        )
        return 1
    shown = frames(scene())
    looks: dict[str, Any] = {"quality": QUALITY, "method": 6}
    duration = round(1000 / RATE)
    shown[0].save(
        FOLDER / "robots.webp",
        save_all=True,
        append_images=shown[1:],
        duration=duration,
        loop=0,
        **looks,
    )
    shown[len(shown) // 3].save(FOLDER / "robots-still.webp", quality=80, method=6)
    return 0


if __name__ == "__main__":
    sys.exit(main())
