"""Statistics of terrains, for comparison with recorded ones.

Run as a script, this module writes the file of the recorded statistics:

python tests/terrain_statistics.py FOLDER > tests/recorded/terrain_quantiles.json

FOLDER holds the recordings ``rough_SYSTEM.npz`` and ``novice_SYSTEM.npz`` of the
released simulator, each with ``terrain`` (n, 300, 300), m: 29 terrains a system.
"""

import json
import re
import sys
from pathlib import Path

import numpy as np

QUANTILES = (0.01, 0.05, 0.25, 0.75, 0.95, 0.99)
LAGS = (0.1, 0.5, 1.0)  # m


def statistics(heights: np.ndarray, spacing: float = 0.1) -> dict[str, np.ndarray]:
    """Quantiles of height, slope and height differences of terrains (n, H, W), m.

    Heights are about each terrain's median.
    """
    heights = heights - np.median(heights, axis=(1, 2), keepdims=True)
    along, across = np.gradient(heights, spacing, axis=(1, 2))
    figures = {"height": heights, "slope": np.hypot(along, across)}
    for lag in LAGS:
        step = round(lag / spacing)
        pairs = (
            heights[:, step:] - heights[:, :-step],
            heights[:, :, step:] - heights[:, :, :-step],
        )
        figures[f"difference at {lag} m"] = np.abs(
            np.concatenate([pair.ravel() for pair in pairs])
        )
    return {name: np.quantile(values, QUANTILES) for name, values in figures.items()}


def main(folder: Path) -> None:
    """Print the recorded terrains' statistics as JSON."""
    recorded = {}
    for system in ("system1", "system2"):
        parts = [
            np.load(folder / f"{kind}_{system}.npz")["terrain"]
            for kind in ("novice", "rough")
        ]
        figures = statistics(np.concatenate(parts).astype(float))
        recorded[system] = {
            name: [round(float(value), 5) for value in values]
            for name, values in figures.items()
        }
    text = json.dumps({"quantiles": QUANTILES, **recorded}, indent=1)
    # a list on one line
    print(re.sub(r"\[[^]]*\]", lambda numbers: " ".join(numbers[0].split()), text))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
