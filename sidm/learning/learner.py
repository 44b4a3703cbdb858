"""Everything that changes while a model is trained, and how it is kept on disk."""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Iterable, Mapping
from pathlib import Path

import torch
from torch import Tensor

from sidm.config import ConfigError, to_mapping
from sidm.learning import checkpoint
from sidm.learning.dataset import Datasets, Windows
from sidm.learning.evaluation import mean_loss
from sidm.learning.evaluation import validation_loss as component_means
from sidm.learning.mirror import mirrored
from sidm.learning.model import DynamicsModel
from sidm.learning.networks import Discriminator, seeded
from sidm.learning.seeds import generator
from sidm.learning.stopping import SPACING, Components, Stopper, Tested, TrainingError
from sidm.learning.units import Standardisation, Units, units_of
from sidm.learning.weights import Follower, make_optimiser
from sidm.settings import Network, Training
from sidm.systems import ROLES

#: What is drawn at random, each from a generator of its own, so that one seed gives all methods the same novice draws.
PURPOSES = ("system", "novice", "expert", "discriminator novice", "discriminator expert", "matching")
MIRRORING = {purpose: f"{purpose} mirrored" for purpose in PURPOSES[1:]}  # what is drawn beside, for its mirror images
DISCRIMINATED = "discriminated system"  # whose latents a discriminator's batch has, where it has those of one


class Learner:
    """A model in training: weights, optimisers, generators, counters, the best weights so far.

    Args:
        datasets: what is learnt from and tested on.
        network: sizes of the networks.
        training: the settings.
        seed: of weights and draws.
        standardisation: units inside the networks, of all systems or of each; by default those of `units_of`.
        device: where to compute.
        start: initial weights; fresh ones by default.
        roles: the systems that the model has; by default the novice, and the expert where it is learnt from.

    Raises:
        ConfigError: the settings do not fit each other, or want data of the expert that are not there.
    """

    kind: type[DynamicsModel] = DynamicsModel
    measured = True  # whether validation losses, and losses by component, are kept

    def __init__(
        self,
        datasets: Datasets,
        network: Network,
        training: Training,
        seed: int,
        standardisation: Units | None = None,
        device: str | torch.device = "cpu",
        start: Mapping[str, Tensor] | None = None,
        roles: Iterable[str] = (),
    ):
        if training.regularise and network.own == "none":
            raise ConfigError("Network.own='none' leaves one encoder, with nothing to match: regularise=False")
        if training.needs_expert and datasets.expert is None:
            raise ConfigError("p_expert above 0 and regularise need the expert's data, but datasets.expert is None")
        roles = tuple(roles) or (ROLES if training.needs_expert else ("novice",))
        for role in roles:
            training.refuse_for(network.body(role))
        if training.units == "raw":
            standardisation = {role: Standardisation.none(network.body(role)) for role in roles}
        elif standardisation is None:
            standardisation = units_of(datasets, network)
        self.datasets, self.network, self.training, self.seed = datasets, network, training, seed
        self.units = checkpoint.digest(_tensors(standardisation))
        self.start = start and checkpoint.digest(start.values())
        self.device = torch.device(device)
        self.test = datasets.test.first(training.test_trajectories)
        self.validation = datasets.validation.first(training.validation_trajectories)
        self.model = self.kind(network, standardisation, seed, roles).to(self.device)
        if start is not None:
            self.model.start(start)
        self.model.sidm.requires_grad_(training.frozen != "sidm")
        self.discriminator = seeded(seed, "discriminator", lambda: Discriminator(network)).to(self.device)
        self.prediction = make_optimiser(self.model, training)
        self.follower = Follower(self.model, training)
        self.discrimination = make_optimiser(self.discriminator, training)
        own = training.matching_optimiser == "own" and "novice" in self.model.encoders
        self.matching = make_optimiser(self.model.encoders["novice"], training) if own else self.prediction
        purposes = (*PURPOSES, *MIRRORING.values(), DISCRIMINATED)
        self.generators = {purpose: generator(seed, purpose) for purpose in purposes}
        self.waiting: dict[str, Tensor] = {}  # of draws without replacement: trajectories by system that come next
        self.stopper = Stopper(training.stopping, training.smoothing, training.patience, training.max_samples)
        self.best = self.weights()
        self.history: list[Tested] = []
        self.components: list[Components] = []
        self.iteration = self.samples = 0  # of the prediction phases
        self.accuracy: float | None = None  # of the discriminator
        self.losses = dict.fromkeys(ROLES, (0.0, 0))  # since the last test: sum of losses and their number, by system

    @property
    def finished(self) -> bool:
        """Whether training ends here."""
        return self.stopper.finished(self.samples, self.iteration)

    def weights(self) -> dict[str, Tensor]:
        """A copy of the model's weights and buffers by name, in their shapes."""
        return {name: tensor.clone() for name, tensor in checkpoint.module_tensors(self.model).items()}

    def part(self, role: str) -> Windows:
        """The trajectories of a system to learn from."""
        motion = self.datasets.expert if role == "expert" else self.datasets.train
        assert motion is not None
        return motion

    def draw_indices(self, role: str, count: int, purpose: str) -> Tensor:
        """(count,) int64: which of a system's trajectories to learn from.

        Without `replacement` all purposes go through one order of the system's trajectories. With `mirror` the
        trajectories' mirror images stand behind them: every second one at random is drawn there.
        """
        if self.training.replacement:
            drawn = torch.randint(len(self.part(role)), (count,), generator=self.generators[purpose])
        else:
            drawn = self._next_indices(role, count)
        if self.training.mirror:
            turned = torch.rand(count, generator=self.generators[MIRRORING[purpose]]) < 0.5
            drawn = drawn + len(self.part(role)) * turned
        return drawn

    def _next_indices(self, role: str, count: int) -> Tensor:
        """(count,) int64: those that come next in a system's random order; a new order begins where one ends."""
        waiting = self.waiting.get(role, torch.zeros(0, dtype=torch.long))
        while len(waiting) < count:
            order = torch.randperm(len(self.part(role)), generator=self.generators[role])
            waiting = torch.cat([waiting, order])
        drawn, self.waiting[role] = waiting[:count], waiting[count:]
        return drawn

    def draw(self, role: str, count: int, purpose: str) -> Windows:
        """`count` random training trajectories of a system, on the device."""
        return self.take(role, self.draw_indices(role, count, purpose))

    def take(self, role: str, which: Tensor) -> Windows:
        """A system's training trajectories (b, T) numbered `which` (b,), or their mirror images, on the device."""
        count = len(self.part(role))
        motion = self.part(role).take(which % count)
        if self.training.mirror:
            motion = mirrored(motion, which >= count)
        return motion.to(self.device)

    def encode(self, role: str, motion: Windows) -> Tensor:
        """Latent state-actions (b, T, 128), float32, computed in the training's precision."""
        low = self.training.precision == "bfloat16"
        with torch.autocast(self.device.type, torch.bfloat16, enabled=low):
            return self.model.encoders[role](motion.inputs, motion.maps)

    def draw_batch_indices(self) -> dict[str, Tensor]:
        """Which b_pred trajectories (b,) make a batch, by system: each the expert's with probability p_e (Algorithm 1).

        Every place of the batch draws a novice's and an expert's trajectory and takes one of them: the novice's is the
        same for all methods. Without `replacement` only what is taken is drawn.
        """
        count = self.training.batch
        of_expert = torch.rand(count, generator=self.generators["system"]) < self.training.p_expert
        if self.training.system_draw == "iteration":
            of_expert = of_expert[:1].expand(count)
        chosen = {}
        for role, mine in zip(ROLES, (~of_expert, of_expert), strict=True):
            if role == "novice" or self.datasets.expert is not None:
                if self.training.replacement:
                    indices = self.draw_indices(role, count, role)[mine]
                else:
                    indices = self.draw_indices(role, int(mine.sum()), role)
                if len(indices):
                    chosen[role] = indices
        return chosen

    def draw_batch(self) -> dict[str, Windows]:
        """The trajectories of a batch by system, on the device."""
        return {role: self.take(role, which) for role, which in self.draw_batch_indices().items()}

    def draw_discriminated(self) -> tuple[str, ...]:
        """The systems whose latents a discriminator's batch has, the expert first."""
        if self.training.discriminator_draw == "both":
            return "expert", "novice"
        of_expert = torch.rand(1, generator=self.generators[DISCRIMINATED]) < 0.5
        return ("expert",) if of_expert else ("novice",)

    def clear_gradients(self) -> None:
        """Begin a step of prediction or matching: no part has a gradient, or each that had one has 0."""
        self.prediction.zero_grad(set_to_none=not self.training.zero_gradients)

    def update(self) -> None:
        """A step of prediction along the gradients, and what follows it."""
        self.prediction.step()
        if self.training.reverses:
            self.discrimination.step()
        self.follower.follow()

    def note(self, losses: dict[str, Tensor]) -> None:
        """Count an iteration of prediction with per-sample `losses` (b, T) by system."""
        self.count({role: loss.numel() for role, loss in losses.items()})
        for role, loss in losses.items():
            self.add_losses(role, float(loss.detach().double().sum()))

    def count(self, samples: Mapping[str, int]) -> None:
        """Count an iteration of prediction with so many samples by system."""
        self.iteration += 1
        for role, number in samples.items():
            self.samples += number
            self.losses[role] = (self.losses[role][0], self.losses[role][1] + number)

    def add_losses(self, role: str, total: float) -> None:
        """Remember a sum of losses of counted samples until the next test."""
        self.losses[role] = (self.losses[role][0] + total, self.losses[role][1])

    def take_test(self) -> Tested:
        """Measure the test loss; keep the weights if its smoothed value is the lowest so far."""
        with self.follower.averaged():
            if self.judge(self.test_loss(), self.validation_loss()):
                self.best = self.weights()
            if self.measured and len(self.validation) and self.components_due:
                self.components.append(self.measure())
        return self.history[-1]

    @property
    def components_due(self) -> bool:
        """Whether losses by component are to be kept of this test."""
        return not self.components or self.samples >= SPACING * self.components[-1].samples

    def test_loss(self) -> float:
        """The loss that training stops by, of the weights as they are now."""
        return mean_loss(self.model, self.test)

    def validation_loss(self) -> float | None:
        """The loss on the validation set of the weights as they are now; None where it is not measured."""
        return mean_loss(self.model, self.validation) if self.measured and len(self.validation) else None

    def measure(self) -> Components:
        """The loss by component of the weights as they are now."""
        test, validation = (component_means(self.model, motion).tolist() for motion in (self.test, self.validation))
        return Components(self.samples, tuple(test), tuple(validation))

    def judge(self, test_loss: float, validation_loss: float | None = None) -> bool:
        """Add a test to the learning curve; whether its smoothed test loss is the lowest so far.

        Raises:
            TrainingError: the test or the training loss is not finite; the test is not added.
        """
        novice, everything = self.losses["novice"], tuple(map(sum, zip(*self.losses.values(), strict=True)))
        total, count = novice if novice[1] else everything
        self.losses = dict.fromkeys(ROLES, (0.0, 0))
        tested = Tested(self.samples, total / max(count, 1), test_loss, self.accuracy, validation_loss)
        for what, loss in (("training", tested.training_loss), ("test", test_loss)):
            if not math.isfinite(loss):
                raise TrainingError(what, loss, self.iteration)
        self.history.append(tested)
        return self.stopper.update(self.samples, self.iteration, tested.training_loss, test_loss)

    def save(self, folder: Path) -> None:
        """Write the whole state as the checkpoint of `folder`."""
        groups = {
            "model": checkpoint.module_tensors(self.model),
            "discriminator": checkpoint.module_tensors(self.discriminator),
            "best": self.best,
            "generators": {purpose: g.get_state() for purpose, g in self.generators.items()},
            "average": self.follower.tensors(),
            "waiting": self.waiting,
        }
        groups |= {name: checkpoint.optimiser_tensors(one) for name, one in self._optimisers().items()}
        tensors = {name: t for group, part in groups.items() for name, t in checkpoint.prefixed(group, part).items()}
        values = {
            "run": self._identity(),
            "stopper": dataclasses.asdict(self.stopper),
            "history": [list(tested) for tested in self.history],
            "components": self.components,
            "iteration": self.iteration,
            "samples": self.samples,
            "accuracy": self.accuracy,
            "losses": {role: list(pair) for role, pair in self.losses.items()},
        }
        checkpoint.write(folder, tensors, values)

    def restore(self, folder: Path) -> bool:
        """Go on from the checkpoint of `folder`, bit for bit; False when there is none.

        Raises:
            CheckpointError: the checkpoint is damaged or of another run.
        """
        found = checkpoint.read(folder)
        if found is None:
            return False
        tensors, values = found
        if values.get("run") != self._identity():
            raise checkpoint.CheckpointError(
                f"{Path(folder) / checkpoint.FILE}: the checkpoint is of another run; delete it or name another folder"
            )
        self.model.load_state_dict(checkpoint.under("model", tensors))
        self.discriminator.load_state_dict(checkpoint.under("discriminator", tensors))
        self.best = {name: tensor.to(self.device) for name, tensor in checkpoint.under("best", tensors).items()}
        for name, optimiser in self._optimisers().items():
            checkpoint.load_optimiser(optimiser, checkpoint.under(name, tensors))
        if self.training.zero_gradients:
            for parameter in self.prediction.state:  # which have had a gradient
                parameter.grad = torch.zeros_like(parameter)
        self.follower.restore(checkpoint.under("average", tensors), values["iteration"])
        for purpose, state in checkpoint.under("generators", tensors).items():
            self.generators[purpose].set_state(state)
        self.waiting = checkpoint.under("waiting", tensors)
        self.stopper = Stopper(**values["stopper"])
        self.history = [Tested(*tested) for tested in values["history"]]
        self.components = [Components(samples, tuple(t), tuple(v)) for samples, t, v in values.get("components", ())]
        self.iteration, self.samples, self.accuracy = values["iteration"], values["samples"], values["accuracy"]
        self.losses = {role: (total, count) for role, (total, count) in values["losses"].items()}
        return True

    def _optimisers(self) -> dict[str, torch.optim.Optimizer]:
        """Those that there are, by the names of their parts of a checkpoint."""
        found = {"prediction": self.prediction, "discrimination": self.discrimination}
        return found if self.matching is self.prediction else found | {"matching": self.matching}

    def _identity(self) -> dict:
        """What makes this run another than the next: configuration, seed, units, initial weights, data."""
        motions = {"train": self.datasets.train, "test": self.datasets.test, "expert": self.datasets.expert}
        return {
            "network": _plain(self.network),
            "training": dataclasses.asdict(self.training),  # type: ignore[call-overload]
            "seed": self.seed,
            "units": self.units,
            "start": self.start,
            "data": {k: checkpoint.digest((m.inputs, m.targets)) for k, m in motions.items() if m is not None},
        }


def _tensors(units: Units) -> list[Tensor]:
    """All numbers of the units, system by system."""
    return [*units] if isinstance(units, Standardisation) else [one for role in sorted(units) for one in units[role]]


def _plain(network: Network) -> dict:
    """A network's sizes as JSON gives them back, without bodies that are the paper's."""
    values = {name: value for name, value in to_mapping(network).items() if value is not None}
    return json.loads(json.dumps(values))
