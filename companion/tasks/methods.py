"""What a method of the benchmark is, and how it is found by its name.

A method is a class with `fit`; what `fit` returns has `predict`, and may have
`rollout`. Motion is of one type, `sidm.Drive`.
"""

from __future__ import annotations

import hashlib
import importlib.util
import sys
from collections.abc import Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Protocol

import numpy as np

from sidm.config import ConfigError, first_line, no_such_file, unknown_name
from sidm.drives import Drive


class FittedModel(Protocol):
    """What a method's `fit` returns."""

    def predict(self, drive: Drive) -> np.ndarray:
        """Transitions (K, Y) of a drive's steps, named by `drive.body.targets`.

        The prediction of step k may use the states 0 to k and the actions 0 to k alone;
        a check finds models that use the state after.
        """
        ...


class EnteredMethod(Protocol):
    """A method of the benchmark."""

    def fit(
        self, novice: Sequence[Drive], expert: Sequence[Drive], seed: int
    ) -> FittedModel:
        """A model of the novice, from its drives and the expert's.

        Raises:
            NotImplementedError: the method is not for such robots; the trial is no
                failure.
        """
        ...


class LibraryMethod:
    """A method of `ownrobot.fit`, with the settings of `ownrobot.fit`."""

    def __init__(self, name: str) -> None:
        self.name = name

    def fit(
        self, novice: Sequence[Drive], expert: Sequence[Drive], seed: int
    ) -> FittedModel:
        """A model of the novice."""
        from ownrobot.fitting.learning import (
            SETTINGS,
            refuse_method,
            require_packages,
        )
        from ownrobot.fitting.single import fit_drives
        from ownrobot.fitting.windows import predict_steps

        require_packages(self.name)
        try:
            refuse_method(self.name, novice[0].body, expert[0].body)
        except ConfigError as error:
            raise NotImplementedError(str(error)) from None
        model = fit_drives(novice, expert, self.name, SETTINGS, seed, notify=False)

        def predict(drive: Drive) -> np.ndarray:
            pixels = model.network.pixels
            ((predicted, _),) = predict_steps(model.predictor, [drive], pixels)
            return predicted.numpy()

        return SimpleNamespace(predict=predict, rollout=model.rollout)


def find_method(name: str) -> tuple[str, str]:
    """A method's `method` and `code` in an `Entry`, from its name on the command line.

    The method is checked.
    """
    if ".py:" not in name:
        from ownrobot.methods.registry import METHODS

        if name.endswith(".py"):
            raise ConfigError(f"{name}: add the name of the class, as {name}:CLASS")
        if name not in METHODS:
            raise unknown_name(name, METHODS, kind="method")
        return name, ""
    path = Path(name.rpartition(":")[0])
    if not path.is_file():
        raise ConfigError(no_such_file(path))
    load_method(name)
    digest = hashlib.sha256(path.read_bytes()).hexdigest()[:12]
    return f"{path.name}:{name.rpartition(':')[2]}", digest


def load_method(name: str) -> EnteredMethod:
    """An instance of a method."""
    if ".py:" not in name:
        return LibraryMethod(name)
    file, _, class_name = name.rpartition(":")
    path = Path(file).resolve()
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[path.stem] = module
    try:
        spec.loader.exec_module(module)
    except Exception as error:  # anything may be wrong in the file
        raise _refused(f"{file}: cannot be imported", error) from None
    kinds = {n: v for n, v in vars(module).items() if hasattr(v, "fit")}
    if class_name not in kinds:
        raise unknown_name(class_name, kinds, file, "class with 'fit'")
    try:
        return kinds[class_name]()
    except Exception as error:  # as above
        raise _refused(f"{name}: cannot be made without arguments", error) from None


def _refused(what: str, error: Exception) -> ConfigError:
    return ConfigError(f"{what} ({type(error).__name__}: {first_line(error)})")
