"""The learning curve, and when to stop: the smoothed test loss no longer falls (section 4)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

RELEASED_SMOOTHING = 0.9  # of the test and the training loss, a test
RELEASED_PATIENCE = 25_000  # prediction iterations
#: of training loss to test loss, below which the model counts as overfit
RELEASED_RATIO = 0.8


class TrainingError(RuntimeError):
    """A run that came to nothing because a loss is not finite; the message is one line."""

    def __init__(self, what: str, loss: float, iteration: int):
        super().__init__(what, loss, iteration)
        self.what, self.loss, self.iteration = what, loss, iteration

    def __str__(self) -> str:
        return (
            f"the {self.what} loss is {self.loss} after {self.iteration} iterations; "
            "lower the learning rate or look at the data"
        )


class Tested(NamedTuple):
    """A point of the learning curve."""

    samples: int  # control steps of the prediction phases so far
    #: equation (1) on the novice's samples since the test before; on all samples if it
    #: had none
    training_loss: float
    test_loss: float  # equation (1) on the novice's test split, not smoothed
    #: share of latents told apart in the last discriminator phase; None without
    discriminator_accuracy: float | None
    #: equation (1) on the validation set, which nothing goes by; None: without
    validation_loss: float | None = None


#: Samples between two measurements by component: each has seen at least so many times
#: those of the one before.
SPACING = 1.12  # of a training of 6 million samples about 40 are kept


class Components(NamedTuple):
    """The loss by component at a point of the learning curve, on the first trajectories of each set."""

    samples: int  # control steps of the prediction phases so far
    #: (13,) summands of equation (1), on the novice's test split
    test: tuple[float, ...]
    #: (13,) the same on the validation set, which nothing goes by
    validation: tuple[float, ...]


@dataclass
class EarlyStopping:
    """Follows the test loss and says when training has to end.

    `rule` 'test_loss' ends it when the smoothed test loss has not had a new minimum for
    `patience` samples; 'released' when that, smoothed by 0.9, has had none for 25,000
    iterations and the training loss is below 0.8 of it. Both end at `max_samples`.
    """

    rule: Literal["test_loss", "released"]
    smoothing: float  # weight of the past in the smoothed loss, [0, 1)
    patience: int  # samples
    max_samples: int
    test_loss: float | None = None  # smoothed
    training_loss: float | None = None  # smoothed
    best: float | None = None  # lowest smoothed test loss
    best_samples: int = 0  # seen when it was reached
    best_iteration: int = 0

    def update(
        self, samples: int, iteration: int, training_loss: float, test_loss: float
    ) -> bool:
        """Take in a test; whether its smoothed loss is the lowest so far."""
        weight = RELEASED_SMOOTHING if self.rule == "released" else self.smoothing
        self.test_loss = _smooth(self.test_loss, test_loss, weight)
        self.training_loss = _smooth(self.training_loss, training_loss, weight)
        if self.best is not None and not self.test_loss < self.best:
            return False
        self.best, self.best_samples, self.best_iteration = (
            self.test_loss,
            samples,
            iteration,
        )
        return True

    def finished(self, samples: int, iteration: int) -> bool:
        """Whether training ends here."""
        if samples >= self.max_samples:
            return True
        if self.test_loss is None or self.training_loss is None:
            return False
        if self.rule == "released":
            waited = iteration - self.best_iteration >= RELEASED_PATIENCE
            return waited and self.training_loss < RELEASED_RATIO * self.test_loss
        return samples - self.best_samples >= self.patience


class Curve(NamedTuple):
    """Every test of a training that was run to its end, E of them."""

    samples: Sequence[int]  # (E,) of the prediction phases so far
    training_loss: Sequence[float]  # (E,) as `Tested` has them
    test_loss: Sequence[float]  # (E,) not smoothed
    validation_loss: Sequence[float]  # (E,)
    iteration: int  # samples of an iteration


class Rule(NamedTuple):
    """When a training ends; it keeps the weights of the lowest smoothed test loss until then."""

    stopping: Literal["test_loss", "released"] = "test_loss"  # the rules of `Stopper`
    smoothing: float = 0.5  # weight of the past in the smoothed test loss
    patience: int | None = None  # samples without a new minimum; None: without end
    most: int | None = None  # samples; None: as many as there are
    #: samples that count as an iteration of the released rule: 2 trajectories of 64
    #: steps
    of_released: int = 128

    def stopper(self) -> EarlyStopping:
        """What follows the tests by this rule."""
        without_end = 2**62
        patience, most = (
            without_end if one is None else one for one in (self.patience, self.most)
        )
        return EarlyStopping(self.stopping, self.smoothing, patience, most)


class Kept(NamedTuple):
    """What a rule keeps of a training."""

    samples: int  # seen when the weights were reached
    test_loss: float  # smoothed, which the rule goes by
    validation_loss: float  # of these weights
    seen: int  # samples at the last test before the end
    ended: bool  # whether the rule ended it; otherwise the training ran no longer


def keep(curve: Curve, rule: Rule) -> Kept:
    """What a training would have kept, had this rule stopped it.

    Raises:
        ValueError: the training was never tested.
    """
    stopper, best, last, ended = rule.stopper(), None, 0, False
    tests = zip(curve.samples, curve.training_loss, curve.test_loss, strict=True)
    for number, (samples, training_loss, test_loss) in enumerate(tests):
        # a training that ends within the tests' interval takes no further test
        before = samples - curve.iteration
        if stopper.finished(before, before // rule.of_released):
            ended = True
            break
        last = samples
        if stopper.update(
            samples, samples // rule.of_released, training_loss, test_loss
        ):
            best = number
    if best is None or stopper.best is None:
        raise ValueError("a training without a test keeps nothing")
    ended = ended or stopper.finished(last, last // rule.of_released)
    return Kept(
        curve.samples[best], stopper.best, curve.validation_loss[best], last, ended
    )


def _smooth(past: float | None, now: float, weight: float) -> float:
    return now if past is None else weight * past + (1 - weight) * now
