"""Sizes of the networks and settings of their training.

The defaults are the paper's choices; other values are variants, of which some are the
released code's. The module does not import PyTorch, so that results can be read
without it.
"""

from __future__ import annotations

from typing import Any, Literal

from sidm.body import ROVER, Body
from sidm.config import ConfigError, check_at_least, check_numbers, config, replace


@config
class Network:
    """Sizes of all networks (section 4).

    The defaults are the paper's, except those of the map and the LSTM.

    Attributes:
        pixels: P, pixels along a side of the height map; the paper has 300
        channels: channels of the encoder's two convolutions
        kernel: side of both convolutions' kernels, pixels; no padding, stride 1
        encoder_hidden: size of the encoder's hidden layer
        latent: size of the latent state-action
        layers: LSTM layers of the SIDM; the paper has 4
        hidden: size of each LSTM layer; the paper has 1024
        latent_transition: size of the latent state transition
        decoder_hidden: size of the decoder's hidden layer
        discriminator_hidden: size of the discriminator's hidden layer (not in the
            paper; the released code's)
        slope: slope of the leaky ReLU below zero
        initialisation: initial weights; 'scaled': signals keep their scale from layer
            to layer; 'pytorch': PyTorch's defaults
        own: which weights of encoder and decoder each system has for itself; both share
            the rest; 'flag': the bias of the encoder's first dense layer, as if the
            system were an input
        novice_body: body of the novice, which defines its X and Y; None: the paper's
        expert_body: body of the expert; None: the paper's

    Examples:
        >>> sidm.Network(pixels=64, hidden=512).layers
        3
    """

    pixels: int = 32
    channels: tuple[int, int] = (8, 4)
    kernel: int = 4
    encoder_hidden: int = 128
    latent: int = 128
    layers: int = 3
    hidden: int = 256
    latent_transition: int = 64
    decoder_hidden: int = 64
    discriminator_hidden: int = 1024
    slope: float = 0.01
    initialisation: Literal["scaled", "pytorch"] = "scaled"
    own: Literal["all", "biases", "flag", "none"] = "all"
    novice_body: Body | None = None
    expert_body: Body | None = None

    def __post_init__(self) -> None:
        """Refuse sizes that make no network."""
        check_numbers(self)
        check_at_least(self, 1, "kernel", "encoder_hidden", "latent", "layers")
        check_at_least(self, 1, "hidden", "latent_transition", "decoder_hidden")
        check_at_least(self, 1, "discriminator_hidden", "channels")
        if not 0 <= self.slope < 1:
            raise ConfigError(f"Network.slope must be in [0, 1), not {self.slope}")
        least = 2 * self.kernel - 1
        bodies = [self.body(role) for role in ("novice", "expert")]
        for pixels in {body.pixels(self.pixels) or self.pixels for body in bodies}:
            if pixels < least:
                raise ConfigError(
                    f"Network.pixels must be at least {least} for two kernels of "
                    f"{self.kernel}, not {pixels}"
                )
        if self.own != "all" and not self.same_body:
            raise ConfigError(
                f"Network.own='{self.own}' shares weights, "
                "which needs robots of one body"
            )

    def body(self, role: str) -> Body:
        """The body of the novice for `role` 'novice', else that of an expert."""
        return (self.novice_body if role == "novice" else self.expert_body) or ROVER

    @property
    def same_body(self) -> bool:
        """Whether novice and expert have equal bodies and so can share weights."""
        novice, expert = self.body("novice"), self.body("expert")
        return novice == replace(expert, name=novice.name)

    def map_side(self, body: Body) -> int:
        """Side of a body's map after both convolutions, pixels; 0 without a map."""
        return max(0, body.pixels(self.pixels) - 2 * (self.kernel - 1))


PAPER_NETWORK = Network(pixels=300, layers=4, hidden=1024)
RELEASED_NETWORK = Network(pixels=64, layers=3, hidden=256)


@config
class Training:
    """Settings of one training run.

    The defaults are the paper's where it gives a value: p_e, 100 prediction and 20
    matching iterations, whole novice trajectories split 75 to 25. A sample is one
    control step.

    Attributes:
        p_expert: p_e, the probability that a trajectory of a batch is the expert's
        regularise: whether Algorithm 2 runs after each phase of Algorithm 1
        batch: b_pred, trajectories in a batch of the prediction phase
        discriminator_batch: b_d, trajectories of each system in a discriminator's batch
        matching_batch: b_g, the novice's trajectories in a batch of the matching phase
        prediction_iterations: iterations of a prediction phase
        discriminator_iterations: iterations of a discriminator phase (not in the paper;
            the released code's)
        matching_iterations: iterations of a matching phase
        learning_rate: learning rate of every optimiser
        weight_decay: weight decay of every optimiser
        test_interval: prediction iterations between two tests
        test_trajectories: trajectories of the test split in a test, at most; the first
            ones are taken
        validation_trajectories: trajectories of the validation set in a test, at most;
            the first ones are taken; training does not depend on their loss
        smoothing: weight of the past in the smoothed test loss, [0, 1)
        patience: samples without a new minimum of the smoothed test loss before
            training ends
        max_samples: samples of the prediction phases, novice and expert together, after
            which training ends with the batch; 0: the initial weights stay as they are
        system_draw: how often the system is drawn; 'trajectory': for each trajectory;
            'iteration': once for a batch (released code)
        decay: how weights decay; 'l2': as a part of the gradient (released code)
        matching_optimiser: optimiser of the matching phase; 'shared': with the moments
            of the prediction optimiser (released code)
        stopping: rule that ends training, of `stopping.EarlyStopping`
        reduction: how the 13 components make up the loss that is minimised; 'mean':
            the released code's
        frozen: weights that do not learn; 'sidm': encoders and decoders alone learn
        units: units inside the networks; 'raw': the released code's
        zero_gradients: whether parts that a batch does not touch have gradients of 0 in
            place of none, so that momentum and L2 decay move them in every step, once
            they have had a gradient (released code)
        replacement: whether trajectories are drawn with replacement; False: each data
            set is gone through in a random order, then in another one (released code)
        discriminator_draw: systems in a discriminator's batch; 'one': either with
            probability 0.5 (released code)
        precision: arithmetic; 'tf32': of all products, on a GPU

    Examples:
        >>> sidm.Training(p_expert=0.5, max_samples=300_000).matching_iterations
        20
    """

    p_expert: float = 0.75
    regularise: bool = True
    batch: int = 8
    discriminator_batch: int = 8
    matching_batch: int = 8
    prediction_iterations: int = 100
    discriminator_iterations: int = 20
    matching_iterations: int = 20
    learning_rate: float = 1e-3
    weight_decay: float = 1e-5
    test_interval: int = 25
    test_trajectories: int = 64
    validation_trajectories: int = 64
    smoothing: float = 0.5
    patience: int = 200_000
    max_samples: int = 1_500_000
    system_draw: Literal["trajectory", "iteration"] = "trajectory"
    decay: Literal["decoupled", "l2"] = "decoupled"
    matching_optimiser: Literal["own", "shared"] = "own"
    stopping: Literal["test_loss", "released"] = "test_loss"
    reduction: Literal["sum", "mean"] = "sum"
    frozen: Literal["nothing", "sidm"] = "nothing"
    units: Literal["standardised", "raw"] = "standardised"
    zero_gradients: bool = False
    replacement: bool = True
    discriminator_draw: Literal["both", "one"] = "both"
    precision: Literal["float32", "tf32"] = "float32"

    def __post_init__(self) -> None:
        """Refuse values that no run can have."""
        check_numbers(self)
        for name in ("p_expert", "smoothing"):
            value = getattr(self, name)
            if not 0 <= value <= 1:
                raise ConfigError(f"Training.{name} must be from 0 to 1, not {value}")
        if self.smoothing == 1:
            raise ConfigError(
                "Training.smoothing must be below 1; 1 would never take in a test"
            )
        check_at_least(self, 1, "batch", "discriminator_batch", "matching_batch")
        check_at_least(self, 1, "prediction_iterations", "test_interval")
        check_at_least(self, 1, "test_trajectories", "patience")
        check_at_least(self, 0, "discriminator_iterations", "matching_iterations")
        check_at_least(self, 0, "weight_decay", "max_samples")
        check_at_least(self, 0, "validation_trajectories")
        if not self.learning_rate > 0:
            raise ConfigError(
                f"Training.learning_rate must be positive, not {self.learning_rate}"
            )

    @property
    def needs_expert(self) -> bool:
        """Whether any phase draws the expert's data."""
        return self.p_expert > 0 or self.regularise

    def check_body(self, body: Body) -> None:
        """Raise ConfigError for the first setting without a meaning for a body."""
        if body != ROVER and self.reduction == "mean":
            raise ConfigError(
                "Training.reduction='mean' is the released code's for its 13 numbers, "
                f"not '{body.name}'"
            )
        if body.weights == "variance" and self.units == "raw":
            raise ConfigError(
                f"Training.units='raw' leaves '{body.name}' no variance to weigh its "
                "loss by"
            )

    def trainer(self) -> type[Any] | None:
        """A study's subclass of `learning.trainer.Trainer`; None here."""
        return None
