"""The method: what the networks see, the networks, their losses, training and evaluation; without PyBullet."""

from sidm.lazy import on_demand

__getattr__, __dir__, __all__ = on_demand(
    __name__,
    checkpoint="CheckpointError",
    dataset="Datasets Motion load_motion novice_split prepare",
    evaluation="rollout rollout_errors validation_loss",
    model="DynamicsModel",
    networks="SIDM Decoder Discriminator Encoder parameter_count",
    observation="encode_inputs integrate robot_centred_map transition",
    settings="PAPER_NETWORK RELEASED_NETWORK Network Training",
    training="Tested Trained TrainingError train",
    units="Standardisation",
)
