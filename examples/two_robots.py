"""How much motion of an expensive simulated robot can a cheap one save?

    python examples/two_robots.py --minutes 5 --out two-robots

Simulate two robots whose springs you set in `soft_pair`, train a system invariant
dynamics model (SIDM) and a model of the novice alone on the same drives, evaluate both
on drives that neither was trained on, and draw the path of the novice that each
predicts.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import matplotlib.pyplot as plt

import ownrobot
import sidm


def soft_pair() -> sidm.System:
    """The paper's first pair with a softer novice, and rougher ground for both."""
    pair = sidm.SYSTEMS["system1"]
    return pair.replace(
        name="soft",
        novice=pair.novice.replace(spring=500.0, damping=20.0),  # N/m, N s/m
        terrain=sidm.Terrain(cell_height_scale=0.4),
    )


def draw(models: dict[str, ownrobot.Model], drive: sidm.Drive, path: Path) -> None:
    """Draw a drive and each model's prediction of it, seen from above, in a file."""
    figure, axes = plt.subplots(figsize=(6, 5), layout="constrained")
    axes.plot(*drive.states[:, :2].T, color="black", label="the novice")
    for name, model in models.items():
        predicted = model.rollout(drive.states[0], drive.actions, ground=drive.ground)
        axes.plot(*predicted[:, :2].T, "--", label=name)
    axes.set(xlabel="x (m)", ylabel="y (m)", aspect="equal")
    axes.legend()
    figure.savefig(path)


def parse_arguments() -> argparse.Namespace:
    """The options on the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    text = "minutes of the novice's motion (%(default)g)"
    parser.add_argument("--minutes", type=float, default=5.0, help=text)
    text = "minutes of the expert's motion (%(default)g)"
    parser.add_argument("--expert-minutes", type=float, default=60.0, help=text)
    text = "largest number of samples in a training (%(default)s)"
    parser.add_argument("--samples", type=int, default=300_000, help=text)
    text = "processes that simulate (%(default)s)"
    parser.add_argument("--workers", type=int, default=2, help=text)
    text = "folder of all results (%(default)s)"
    parser.add_argument("--out", type=Path, default=Path("two-robots"), help=text)
    return parser.parse_args()


def main() -> None:
    """Simulate the drives, train both models, evaluate them, draw their predictions."""
    options = parse_arguments()
    pair, out = soft_pair(), options.out
    minutes, expert_minutes = options.minutes, options.expert_minutes
    work = {"folder": out / "data", "workers": options.workers, "progress": True}
    novice = sidm.simulate(pair, "novice", minutes, seed=0, **work)
    expert = sidm.simulate(pair, "expert", expert_minutes, seed=0, **work)
    unseen = sidm.simulate(pair, "novice", 2.0, seed=1, **work)

    fit = {"settings": {"max_samples": options.samples}, "progress": True}
    models = {
        "SIDM": ownrobot.fit(novice, expert, method="sidm", out=out / "sidm", **fit),
        "novice alone": ownrobot.fit(
            novice, method="novice_only", out=out / "alone", **fit
        ),
    }
    for name, model in models.items():
        print(f"{name}: loss on unseen drives {model.loss(unseen):.3f}, equation (1)")
    draw(models, unseen[0], out / "paths.png")
    print(f"figure: {out / 'paths.png'}")


if __name__ == "__main__":
    main()
