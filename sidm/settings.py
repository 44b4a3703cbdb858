"""How large the networks are and how they are trained: the paper's choices, and the released code's variants of them.

Without PyTorch, so that results can be read without it.
"""

from __future__ import annotations

import dataclasses
from typing import Any, Literal

from sidm.body import ROVER, Body
from sidm.config import ConfigError, config, refuse_below, refuse_nonsense


@config
class Network:
    """Sizes of all networks (section 4); the defaults are the paper's but for the map and the LSTM.

    Attributes:
        pixels: P, a side of the height map; the paper has 300
        channels: of the encoder's two convolutions
        kernel: a side of both convolutions' kernels; no padding, stride 1
        encoder_hidden: the encoder's hidden layer
        latent: size of the latent state-action
        layers: LSTM layers of the SIDM; the paper has 4
        hidden: size of each LSTM layer; the paper has 1024
        latent_transition: size of the latent state transition
        decoder_hidden: the decoder's hidden layer
        discriminator_hidden: the discriminator's hidden layer (not in the paper; the
            released code's)
        slope: of the leaky ReLU below zero
        initialisation: of weights; 'pytorch': its own
        own: what each system has of encoder and decoder for itself, the rest being
            common to both; 'flag': the bias of the encoder's first dense layer, as if
            the system were an input
        novice_body: the novice's X and Y; none: the paper's
        expert_body: the expert's

    Raises:
        ConfigError: an unknown name, a wrong type, or sizes that make no network.

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
        refuse_nonsense(self)
        refuse_below(
            self,
            1,
            "kernel",
            "encoder_hidden",
            "latent",
            "layers",
            "hidden",
            "latent_transition",
            "decoder_hidden",
            "discriminator_hidden",
            "channels",
        )
        if not 0 <= self.slope < 1:
            raise ConfigError(f"Network.slope must be in [0, 1), not {self.slope}")
        for pixels in {
            self.body(role).pixels(self.pixels) or self.pixels
            for role in ("novice", "expert")
        }:
            if pixels <= 2 * (self.kernel - 1):
                raise ConfigError(
                    f"Network.pixels must be at least {2 * self.kernel - 1} for two kernels of {self.kernel}, "
                    f"not {pixels}"
                )
        if self.own != "all" and not self.alike:
            raise ConfigError(
                f"Network.own='{self.own}' shares weights, which needs robots of one body"
            )

    def body(self, role: str) -> Body:
        """The body of the novice, or of an expert."""
        return (self.novice_body if role == "novice" else self.expert_body) or ROVER

    @property
    def alike(self) -> bool:
        """Whether novice and expert have one body, so that weights of one fit the other."""
        novice, expert = (self.body(role) for role in ("novice", "expert"))
        return novice == dataclasses.replace(expert, name=novice.name)  # type: ignore[type-var]

    def map_side(self, body: Body) -> int:
        """A side of what the convolutions leave of a body's map; 0 without one."""
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
        p_expert: p_e: probability that a trajectory of a batch is the expert's
        regularise: whether Algorithm 2 runs after each phase of Algorithm 1
        batch: b_pred, trajectories
        discriminator_batch: b_d, trajectories of each system
        matching_batch: b_g, trajectories of the novice
        prediction_iterations: a phase
        discriminator_iterations: a phase (not in the paper; the released code's)
        matching_iterations: a phase
        learning_rate: of every optimiser
        weight_decay: of every optimiser
        test_interval: prediction iterations between two tests
        test_trajectories: of the test split, at most, in a test: the first ones
        validation_trajectories: of the validation set, at most, in a test: the first
            ones; nothing goes by them
        smoothing: weight of the past in the smoothed test loss, [0, 1)
        patience: samples without a new minimum of the smoothed test loss before
            training ends
        max_samples: of the prediction phases, novice and expert together; 0: the start
            as it is
        system_draw: 'iteration': one system a batch (released code)
        decay: 'l2': in the gradient (released code)
        matching_optimiser: 'shared': the prediction optimiser's moments (released code)
        stopping: the rules of `stopping.EarlyStopping`
        reduction: over the 13 components of the loss that is minimised ('mean':
            released)
        frozen: 'sidm': encoders and decoders alone learn
        units: inside the networks ('raw': released code)
        zero_gradients: whether parts that a batch does not touch have gradients of 0 in
            place of none, so that momentum and L2 decay move them in every step, once
            they have had a gradient (released code)
        replacement: of draws; False: each data set is gone through in a random order,
            then in another one (released code)
        discriminator_draw: systems of a discriminator's batch; 'one': either with
            probability 0.5 (released code)
        precision: 'tf32': of all products, on a GPU; 'bfloat16': of the encoders'
            arithmetic but for the tests'

    Raises:
        ConfigError: an unknown name, a wrong type, or values that no run can have.

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
    precision: Literal["float32", "tf32", "bfloat16"] = "float32"

    def __post_init__(self) -> None:
        """Refuse values that no run can have."""
        refuse_nonsense(self)
        for name in ("p_expert", "smoothing"):
            if not 0 <= getattr(self, name) <= 1:
                raise ConfigError(
                    f"Training.{name} must be from 0 to 1, not {getattr(self, name)}"
                )
        if self.smoothing == 1:
            raise ConfigError(
                "Training.smoothing must be below 1; 1 would never take in a test"
            )
        refuse_below(
            self,
            1,
            "batch",
            "discriminator_batch",
            "matching_batch",
            "prediction_iterations",
            "test_interval",
            "test_trajectories",
            "patience",
        )
        refuse_below(
            self,
            0,
            "discriminator_iterations",
            "matching_iterations",
            "weight_decay",
            "max_samples",
            "validation_trajectories",
        )
        if not self.learning_rate > 0:
            raise ConfigError(
                f"Training.learning_rate must be positive, not {self.learning_rate}"
            )

    @property
    def needs_expert(self) -> bool:
        """Whether any phase draws the expert's data."""
        return self.p_expert > 0 or self.regularise

    def refuse_for(self, body: Body) -> None:
        """ConfigError naming the first setting that has a meaning for the paper's body alone."""
        if body != ROVER and self.reduction == "mean":
            raise ConfigError(
                f"Training.reduction='mean' is the released code's for its 13 numbers, not '{body.name}'"
            )
        if body.weights == "variance" and self.units == "raw":
            raise ConfigError(
                f"Training.units='raw' leaves '{body.name}' no variance to weigh its loss by"
            )

    def hooks(self) -> tuple[Any, ...]:
        """What a study adds to the training loop, of `learning.trainer.Hook`; these settings add nothing."""
        return ()
