"""The mirror image of a motion is what the mirrored robot would have seen and done."""

import numpy as np
import pytest
import torch

from companion.beyond.mirror import mirrored
from sidm.learning import Windows, encode_inputs, robot_centred_map, transition

#: of a state, by y to -y
REFLECTED = torch.tensor([1, -1, 1, -1, 1, -1, 1, 1, -1, 1, -1, 1, -1.0]).double()


@pytest.fixture
def seen(make_trajectories, small_terrain):
    """Motion of one trajectory, and of its reflection: y to -y in the world, left
    steering for right."""

    def motion(reflect: bool) -> Windows:
        (trajectory,) = make_trajectories(1)
        states = torch.tensor(trajectory.states).double()
        actions = torch.tensor(trajectory.actions).double()
        heights = trajectory.ground.heights
        if reflect:
            states, actions, heights = (
                states * REFLECTED,
                actions * torch.tensor([1, -1]),
                heights[::-1].copy(),
            )
        maps = robot_centred_map(heights, states[:-1], 8)
        return Windows(
            encode_inputs(states[:-1], actions)[None],
            transition(states[:-1], states[1:])[None],
            maps[None],
        )

    return motion


def test_a_mirrored_motion_is_that_of_the_reflected_world(seen):
    """Inputs, transitions and maps, from the geometry and not from the table of
    signs."""
    found, expected = mirrored(seen(False), torch.tensor([True])), seen(True)
    assert torch.allclose(found.inputs, expected.inputs, atol=1e-9)
    assert torch.allclose(found.targets, expected.targets, atol=1e-9)
    # A cell's two triangles are cut from corner (0, 1) to (1, 0), in the mirror image
    # the other way.
    assert (
        float((found.maps - expected.maps).abs().max())
        < 0.1
        < float(np.ptp(expected.maps.numpy()))
    )


def test_only_the_chosen_trajectories_turn_and_twice_is_back(make_motion):
    motion, which = make_motion(4), torch.tensor([True, False, True, False])
    once = mirrored(motion, which)
    assert torch.equal(once.inputs[1::2], motion.inputs[1::2]) and torch.equal(
        once.maps[1::2], motion.maps[1::2]
    )
    assert not torch.equal(once.targets[0], motion.targets[0]) and not torch.equal(
        once.maps[2], motion.maps[2]
    )
    twice = mirrored(once, which)
    for name in ("inputs", "targets", "maps"):
        assert torch.equal(getattr(twice, name), getattr(motion, name))


def test_seeds_pair_mirror_images_too(make_trainer):
    """What is the novice's in two batches is turned in both or in neither, whatever
    else is drawn."""
    one, other = (
        make_trainer(p_expert=p, mirror=True, regularise=False, batch=8)
        for p in (0.0, 0.5)
    )
    for _ in range(5):
        alone, both = (
            trainer.sampler.batch_indices()["novice"].tolist()
            for trainer in (one, other)
        )
        assert 0 < len(both) < 8 and all(place in alone for place in both)
        # of six trajectories, images stand from 6 on
        assert len(set(alone) - set(range(6))) > 0


def test_training_draws_mirror_images_and_the_same_trajectories(make_trainer):
    plain, turned = make_trainer(p_expert=0.0), make_trainer(p_expert=0.0, mirror=True)
    same = 0
    for _ in range(10):
        one, other = (
            plain.sampler.draw("novice", 8, "novice"),
            turned.sampler.draw("novice", 8, "novice"),
        )
        # up along x has no sign to change
        assert torch.equal(one.inputs[..., 0], other.inputs[..., 0])
        same += int((one.inputs == other.inputs).all(2).all(1).sum())
    assert 20 < same < 60  # of 80
