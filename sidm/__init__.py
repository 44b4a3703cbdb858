"""A reproducible companion to Wang and Johnson, 'Domain Adaptation Using System Invariant Dynamics Models' (L4DC 2021).

The wings, each importing only from those before it: `sidm.systems`, `sidm.terrain`, `sidm.rotations` and
`sidm.trajectory`; `sidm.simulation` (PyBullet); `sidm.learning` (PyTorch); `sidm.experiments`; `sidm.notebook` and the
command line, `sidm`. Importing `sidm` itself imports none of them.
"""

__version__ = "0.1.0"
