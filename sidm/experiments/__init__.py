"""Many trials: what is run, kept and shown; PyBullet is imported inside the function that collects data alone."""

from sidm.experiments.engine.datasets import collect_datasets
from sidm.experiments.engine.records import StoreError
from sidm.experiments.engine.store import Failure, Outcome, Results, Row
from sidm.experiments.methods import METHODS
from sidm.experiments.presets import PRESETS, Preset, load_preset
from sidm.experiments.study import Study
from sidm.experiments.trials import UNKNOWN, Dataset, Trial
from sidm.lazy import on_demand

__all__ = [
    "FIGURES", "METHODS", "PRESETS", "UNKNOWN", "Dataset", "Failure", "Outcome", "Preset", "Results", "Row",
    "StoreError", "Study", "Trial", "collect_datasets", "grid", "load_preset", "perform", "run",
    "run_trial",
]  # fmt: skip

__getattr__, __dir__, _ = on_demand(
    __name__, **{"engine.run": "run", "engine.execute": "perform run_trial", "grids": "FIGURES grid"}
)
