"""A mirrored motion is what the mirrored robot would observe and do."""

import numpy as np
import pytest
import torch

from companion.beyond.mirror import mirrored
from sidm.learning import Windows, encode_inputs, robot_centred_map, transition

#: signs of the components of a state when y becomes -y
REFLECTED = torch.tensor([1, -1, 1, -1, 1, -1, 1, 1, -1, 1, -1, 1, -1.0]).double()


@pytest.fixture
def seen(make_trajectories, small_terrain):
    """Motion of a trajectory and of its reflection, with y and steering negated."""

    def motion(reflect: bool) -> Windows:
        (trajectory,) = make_trajectories(1)
        states = torch.tensor(trajectory.states).double()
        actions = torch.tensor(trajectory.actions).double()
        heights = trajectory.ground.heights
        if reflect:
            states = states * REFLECTED
            actions = actions * torch.tensor([1, -1])
            heights = heights[::-1].copy()
        maps = robot_centred_map(heights, states[:-1], 8)
        return Windows(
            encode_inputs(states[:-1], actions)[None],
            transition(states[:-1], states[1:])[None],
            maps[None],
        )

    return motion


def test_a_mirrored_motion_is_that_of_the_reflected_world(seen):
    """Inputs, transitions and maps follow from geometry, without the table of signs."""
    reflected, expected = mirrored(seen(False), torch.tensor([True])), seen(True)
    assert torch.allclose(reflected.inputs, expected.inputs, atol=1e-9)
    assert torch.allclose(reflected.targets, expected.targets, atol=1e-9)
    # The two triangles of a cell meet on the line from (0, 1) to (1, 0); in the mirror
    # image they meet on the other diagonal.
    error = float((reflected.maps - expected.maps).abs().max())
    assert error < 0.1 < float(np.ptp(expected.maps.numpy()))


def test_only_the_chosen_trajectories_turn_and_twice_is_back(make_motion):
    motion, which = make_motion(4), torch.tensor([True, False, True, False])
    once = mirrored(motion, which)
    assert torch.equal(once.inputs[1::2], motion.inputs[1::2])
    assert torch.equal(once.maps[1::2], motion.maps[1::2])
    assert not torch.equal(once.targets[0], motion.targets[0])
    assert not torch.equal(once.maps[2], motion.maps[2])
    twice = mirrored(once, which)
    for name in ("inputs", "targets", "maps"):
        assert torch.equal(getattr(twice, name), getattr(motion, name))


def test_seeds_pair_mirror_images_too(make_trainer):
    """A novice's trajectory in two batches is mirrored in both or in neither.

    The other draws make no difference.
    """
    first, other = (
        make_trainer(p_expert=p, mirror=True, regularise=False, batch=8)
        for p in (0.0, 0.5)
    )
    for _ in range(5):
        alone, both = (
            trainer.sampler.batch_indices()["novice"].tolist()
            for trainer in (first, other)
        )
        assert 0 < len(both) < 8 and all(place in alone for place in both)
        # the mirror images of six trajectories have the numbers from 6 on
        assert len(set(alone) - set(range(6))) > 0


def test_training_draws_mirror_images_and_the_same_trajectories(make_trainer):
    plain, turned = make_trainer(p_expert=0.0), make_trainer(p_expert=0.0, mirror=True)
    same = 0
    for _ in range(10):
        one = plain.sampler.draw("novice", 8, "novice")
        other = turned.sampler.draw("novice", 8, "novice")
        # the x component of the upward direction keeps its sign
        assert torch.equal(one.inputs[..., 0], other.inputs[..., 0])
        same += int((one.inputs == other.inputs).all(2).all(1).sum())
    assert 20 < same < 60  # of 80
