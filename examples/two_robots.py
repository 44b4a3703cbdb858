"""Two simulated robots with springs of your own: how much motion of the expensive one can the cheap one save?

    python examples/two_robots.py --minutes 5 --out two-robots

It simulates a pair, trains a system invariant dynamics model (SIDM) and a model of the
novice alone on the same drives, evaluates both on drives that neither has seen, and
draws where each predicts that the novice goes.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import matplotlib.pyplot as plt

import sidm


def springs_of_your_own() -> sidm.System:
    """The paper's first pair, with softer springs for the novice and rougher ground for both."""
    pair = sidm.SYSTEMS["system1"]
    return sidm.System(
        name="soft",
        novice=pair.novice.replace(spring=500.0, damping=20.0),  # N/m, N s/m
        expert=pair.expert,
        terrain=sidm.Terrain(cell_height_scale=0.4),
    )


def draw(models: dict[str, sidm.Model], drive: sidm.Drive, path: Path) -> None:
    """A drive from above, and what each model predicts from its start."""
    figure, axes = plt.subplots(figsize=(6, 5), layout="constrained")
    axes.plot(*drive.states[:, :2].T, color="black", label="the novice")
    for name, model in models.items():
        predicted = model.rollout(drive.states[0], drive.actions, ground=drive.ground)
        axes.plot(*predicted[:, :2].T, "--", label=name)
    axes.set(xlabel="x (m)", ylabel="y (m)", aspect="equal")
    axes.legend()
    figure.savefig(path)


def main() -> None:
    """Simulate, train, evaluate, draw."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "--minutes",
        type=float,
        default=5.0,
        help="of the novice's motion (%(default)g)",
    )
    parser.add_argument(
        "--expert-minutes",
        type=float,
        default=60.0,
        help="of the expert's motion (%(default)g)",
    )
    parser.add_argument(
        "--samples",
        type=int,
        default=300_000,
        help="that each training sees at most (%(default)s)",
    )
    parser.add_argument(
        "--workers", type=int, default=2, help="processes that simulate (%(default)s)"
    )
    parser.add_argument(
        "--out",
        type=Path,
        default=Path("two-robots"),
        help="folder of what is made (%(default)s)",
    )
    given = parser.parse_args()

    pair, data = springs_of_your_own(), given.out / "data"
    how = {"folder": data, "workers": given.workers, "progress": True}
    novice = sidm.simulate(pair, "novice", given.minutes, seed=0, **how)
    expert = sidm.simulate(pair, "expert", given.expert_minutes, seed=0, **how)
    unseen = sidm.simulate(pair, "novice", 2.0, seed=1, **how)

    settings = {"max_samples": given.samples}
    models = {
        "SIDM": sidm.fit(
            novice,
            expert,
            method="sidm",
            settings=settings,
            out=given.out / "sidm",
            progress=True,
        ),
        "novice alone": sidm.fit(
            novice, settings=settings, out=given.out / "alone", progress=True
        ),
    }
    for name, model in models.items():
        print(f"{name}: loss on unseen drives {model.loss(unseen):.3f}, equation (1)")
    draw(models, unseen[0], given.out / "paths.png")
    print(f"figure: {given.out / 'paths.png'}")


if __name__ == "__main__":
    main()
