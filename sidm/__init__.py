"""Dynamics models of robots that share what they learn: Wang and Johnson, L4DC 2021.

The paper's pairs of robots, their simulation, its networks and its training. A public
name is imported when it is first used. The book's reference describes the modules that
the names come from.

Examples:
    >>> import sidm
    >>> drives = sidm.simulate("system1", "novice", minutes=0.2, seed=0)
    >>> drives[0].states.shape
    (65, 13)
"""

from sidm.lazy import public

__version__ = "0.3.0"

#: Module -> its public names.
_MODULES = {
    "sidm.systems": "SYSTEMS System Robot Terrain",
    "sidm.body": "Body",
    "sidm.drives": "Drive Ground",
    "sidm.settings": "Network Training",
    "sidm.simulation.motion": "simulate",
    "sidm.learning.training": "train",
}
__all__, __getattr__, __dir__ = public(__name__, _MODULES)
