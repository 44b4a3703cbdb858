"""Units in which the networks compute: numbers of mean 0 and standard deviation 1."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import NamedTuple

import torch
from torch import Tensor

from sidm.body import ROVER, Body
from sidm.config import ConfigError
from sidm.learning.dataset import Datasets, Windows
from sidm.settings import Network

SMALLEST_STD = 1e-6  # of a component that changes; one that does not keeps its raw unit


class Standardisation(NamedTuple):
    """Units in which the networks work: (raw - mean) / std."""

    input_mean: Tensor  # (X,) float32
    input_std: Tensor  # (X,)
    map_mean: Tensor  # (), m
    map_std: Tensor  # (), m
    target_mean: Tensor  # (Y,)
    target_std: Tensor  # (Y,)

    @classmethod
    def none(cls, body: Body = ROVER) -> Standardisation:
        """Raw units."""
        zeros, ones = torch.zeros, torch.ones
        x, y = len(body.inputs), len(body.targets)
        return cls(zeros(x), ones(x), zeros(()), ones(()), zeros(y), ones(y))

    @classmethod
    def of(cls, motion: Windows, maps_from: int = 256) -> Standardisation:
        """Mean and standard deviation over the steps of `motion`; maps: of its first `maps_from` trajectories."""
        input_mean, input_std = _moments([motion.inputs.flatten(0, 1)])
        maps = motion.first(maps_from).take(range(min(maps_from, len(motion)))).maps
        map_mean, map_std = _moments(one.reshape(-1, 1) for one in maps)
        target_mean, target_std = _moments([motion.targets.flatten(0, 1)])
        return cls(
            input_mean, input_std, map_mean[0], map_std[0], target_mean, target_std
        )


#: of all systems, or of each by its role
Units = Standardisation | Mapping[str, Standardisation]


def units_of(datasets: Datasets, network: Network) -> Units:
    """The units inside the networks: the expert's for both of the paper's bodies, else those of each system.

    Raises:
        ConfigError: there are no data of the expert to take them from.
    """
    if network.body("novice") == network.body("expert") == ROVER:
        if datasets.expert is None:
            raise ConfigError(
                "without the expert's data pass `standardisation`, the same for all methods compared"
            )
        return Standardisation.of(datasets.expert)
    own = {"novice": Standardisation.of(datasets.train)}
    return (
        own
        if datasets.expert is None
        else own | {"expert": Standardisation.of(datasets.expert)}
    )


def loss_weights(body: Body, units: Standardisation) -> Tensor | None:
    """Weights (Y,) of the components in equation (1): 1 over the variance, or None where all are 1."""
    return (
        units.target_std.square().reciprocal() if body.weights == "variance" else None
    )


def units_for(units: Units, role: str) -> Standardisation:
    """Those of one system."""
    return units if isinstance(units, Standardisation) else units[role]


def _moments(parts: Iterable[Tensor]) -> tuple[Tensor, Tensor]:
    """Mean and standard deviation (K,), float32, of the rows of all `parts`, each (., K)."""
    count, total, squares = 0, torch.zeros(()), torch.zeros(())
    for part in parts:
        wide = part.double()
        count, total, squares = (
            count + len(wide),
            total + wide.sum(0),
            squares + wide.square().sum(0),
        )
    mean = total / max(count, 1)  # of no maps there are none
    std = (squares / max(count, 1) - mean.square()).clamp_min(0).sqrt()
    return mean.float(), torch.where(std > SMALLEST_STD, std, 1.0).float()
