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

#: standard deviation below which a component counts as constant
SMALLEST_STD = 1e-6


class Standardisation(NamedTuple):
    """Units in which the networks work: (raw - mean) / std.

    A constant input or map keeps its raw unit, std 1. A constant target has std 0.
    """

    input_mean: Tensor  # (X,) float32
    input_std: Tensor  # (X,)
    map_mean: Tensor  # (), m
    map_std: Tensor  # (), m
    target_mean: Tensor  # (Y,)
    target_std: Tensor  # (Y,)

    @classmethod
    def none(cls, body: Body = ROVER) -> Standardisation:
        """Raw units: means of 0 and standard deviations of 1."""
        zeros, ones = torch.zeros, torch.ones
        x, y = len(body.inputs), len(body.targets)
        return cls(zeros(x), ones(x), zeros(()), ones(()), zeros(y), ones(y))

    @classmethod
    def fit(cls, windows: Windows, maps_from: int = 256) -> Standardisation:
        """Mean and standard deviation over the steps of one system's windows.

        Those of the maps come from the first `maps_from` windows.
        """
        maps = windows.first(maps_from).maps
        map_mean, map_std = _moments(window.reshape(-1, 1) for window in maps)
        input_mean, input_std = _moments([windows.inputs.flatten(0, 1)])
        targets = _moments([windows.targets.flatten(0, 1)])
        of_maps = map_mean[0], divisor(map_std)[0]
        return cls(input_mean, divisor(input_std), *of_maps, *targets)


#: one standardisation for all systems, or one for each by its role
Units = Standardisation | Mapping[str, Standardisation]


def default_units(datasets: Datasets, network: Network) -> Units:
    """The units inside the networks.

    Two robots with the paper's body share the units of the expert's data; otherwise
    each system has the units of its own data.
    """
    if network.body("novice") == network.body("expert") == ROVER:
        if datasets.expert is None:
            raise ConfigError(
                "without the expert's data pass `standardisation`, "
                "the same for all methods compared"
            )
        return Standardisation.fit(datasets.expert)
    units = {"novice": Standardisation.fit(datasets.train)}
    if datasets.expert is not None:
        units["expert"] = Standardisation.fit(datasets.expert)
    return units


def loss_weights(body: Body, units: Standardisation) -> Tensor | None:
    """Weights (Y,) of the components in equation (1).

    They are 1 over the variance, or None where all are 1. A component that varies by no
    more than its sensor resolves has weight 0, a constant one with it: it is rounding
    noise, and divided by its variance it would be as much of the loss as any other.
    """
    if body.weights != "variance":
        return None
    std = units.target_std
    unresolved = std <= std.new_tensor(body.resolutions)
    return std.square().reciprocal().masked_fill(unresolved, 0.0)


def divisor(std: Tensor) -> Tensor:
    """Standard deviations to divide by: 1 where a component is constant."""
    return torch.where(std > 0, std, 1.0)


def role_units(units: Units, role: str) -> Standardisation:
    """The units of one system."""
    return units if isinstance(units, Standardisation) else units[role]


def _moments(parts: Iterable[Tensor]) -> tuple[Tensor, Tensor]:
    """Mean and deviation (K,), float32, of all rows (., K); 0 of a constant."""
    count, total, squares = 0, torch.zeros(()), torch.zeros(())
    for part in parts:
        rows = part.double()
        count += len(rows)
        total = total + rows.sum(0)
        squares = squares + rows.square().sum(0)
    mean = total / max(count, 1)  # there may be no map at all
    std = (squares / max(count, 1) - mean.square()).clamp_min(0).sqrt()
    return mean.float(), torch.where(std > SMALLEST_STD, std, 0.0).float()
