"""Streams of random numbers from one seed."""

from sidm.learning.seeds import derive


def test_seeds_and_purposes_differ():
    found = {
        derive(seed, purpose)
        for seed in range(50)
        for purpose in ("novice", "expert", "matching")
    }
    assert len(found) == 150 and all(0 <= seed < 2**63 for seed in found)


def test_derivation_is_the_same_everywhere():
    assert derive(0, "novice") == 1983752819106747147
    assert derive(7, "sidm") == 3645598144258301059
