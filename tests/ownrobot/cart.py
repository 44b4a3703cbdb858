"""Drives of a made-up cart whose speed follows its throttle with a lag."""

import numpy as np

from sidm.body import Body
from sidm.drives import Drive


def planar(name: str, columns: dict[str, str], actions: dict[str, str]) -> Body:
    units = {"columns": tuple(columns.items()), "actions": tuple(actions.items())}
    return Body(name=name, pose="planar", **units)


CART = planar("cart", {"speed": "m/s"}, {"throttle": "1"})


def cart_drive(rng, steps, session="", name="", turn=0.05, spin=0.0):
    """A drive that turns `turn` rad for each m/s of a step, and `spin` rad anyhow."""
    throttle = np.repeat(rng.uniform(-1, 1, -(-steps // 5)), 5)[:steps]
    speed, yaw = np.zeros(steps + 1), np.zeros(steps + 1)
    for k in range(steps):
        speed[k + 1] = 0.8 * speed[k] + 0.4 * throttle[k]
        yaw[k + 1] = yaw[k] + turn * speed[k] + spin
    speed += 0.01 * rng.standard_normal(steps + 1)
    x, y = (np.cumsum(0.1 * speed * f(yaw)) for f in (np.cos, np.sin))
    states = np.stack([x, y, yaw, speed], 1)
    return Drive(states, throttle[:, None], CART, name=name, session=session)
