"""Which clock the messages of a bag follow.

A message has the time when it was received, and often a stamp in its header, when it
was measured. Stamps count: a message may come late, and a simulation may run faster or
slower than real time. Messages without stamps, as `geometry_msgs/Twist`, are brought to
the clock of the stamps, as are topics whose stamps do not grow or are of another clock
than those of the pose.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

#: Stamps and times of receipt are of one clock if they differ by less, median, s ...
SAME_CLOCK = 5.0
#: ... and their spans by less than this share.
SAME_SPAN = 0.05
#: Stamps that span less than this share of the times of receipt do not grow.
STANDING = 0.01
#: A lag between stamps and receipt that is named, median, s.
NAMED_LAG = 0.1


class Messages(NamedTuple):
    """The messages of one topic, in the order in which they came."""

    topic: str
    received: np.ndarray  # (N,) s; 0 before a simulation's first clock
    stamps: np.ndarray | None  # (N,) s; None where the messages have none
    #: name -> the messages (n,) that have it, and its values (n,)
    columns: dict[str, tuple[np.ndarray, np.ndarray]]

    @property
    def known(self) -> np.ndarray:
        """Times of receipt (N,), s; NaN before a simulation's first clock."""
        return np.where(self.received > 0, self.received, np.nan)

    @property
    def spans(self) -> tuple[float, float, float]:
        """Spans of stamps and of receipt, and the median lag between both, s."""
        there = self.received > 0
        if self.stamps is None or there.sum() < 2:
            return 0.0, 0.0, 0.0
        stamps, received = self.stamps[there], self.received[there]
        lag = float(np.median(received - stamps))
        return float(np.ptp(stamps)), float(np.ptp(received)), lag

    @property
    def has_one_clock(self) -> bool:
        """Whether stamps and times of receipt are of one clock."""
        stamps, received, lag = self.spans
        return abs(lag) < SAME_CLOCK and abs(stamps - received) <= SAME_SPAN * received


def on_one_clock(topics: Sequence[Messages]) -> tuple[list[np.ndarray], list[str]]:
    """Times (N,), s, of each topic on one clock, and what must be told about it.

    A time is NaN where a message has none.
    """
    reference, usable, notes = None, [], []
    for one in topics:
        fault = ""
        if one.stamps is not None:
            stamps, received, _ = one.spans
            if stamps < STANDING * received:
                fault = "do not grow"
            elif reference is None:
                reference = one
            else:
                apart = np.nanmedian(one.stamps - _to_stamps(one.known, reference))
                if abs(apart) > SAME_CLOCK:
                    fault = f"are {abs(apart):.3g} s from those of {reference.topic}"
        if fault:
            notes.append(f"{one.topic}: its stamps {fault}; the times of receipt count")
        usable.append(one._replace(stamps=None) if fault else one)
    if reference is None:
        return [one.known for one in usable], notes
    names = ", ".join(sorted({one.topic for one in topics if one.stamps is None}))
    notes += filter(None, map(_lag, usable))
    if names and not reference.has_one_clock:
        notes.append(
            f"{names}: without stamps, brought to the clock of those of "
            f"{reference.topic} by the times of receipt"
        )
    times = [
        _to_stamps(one.known, reference) if one.stamps is None else one.stamps
        for one in usable
    ]
    return times, notes


def _lag(one: Messages) -> str:
    """A line about a topic whose stamps and times of receipt differ; '' otherwise."""
    stamps, received, lag = one.spans
    if abs(stamps - received) > SAME_SPAN * max(stamps, received):
        return (
            f"{one.topic}: its messages span {received:.4g} s by their times of "
            f"receipt and {stamps:.4g} s by their stamps; the stamps count"
        )
    if one.has_one_clock and abs(lag) > NAMED_LAG:
        way = "after" if lag > 0 else "before"
        return (
            f"{one.topic}: its messages come {abs(lag):.2g} s {way} their stamps; the "
            "stamps count"
        )
    return ""


def _to_stamps(received: np.ndarray, reference: Messages) -> np.ndarray:
    """Times of receipt (N,) brought to the clock of another topic's stamps."""
    if reference.has_one_clock:
        return received
    assert reference.stamps is not None
    there = reference.received > 0
    known, where = np.unique(reference.received[there], return_inverse=True)
    stamps = np.bincount(where, reference.stamps[there]) / np.bincount(where)
    before, after = received - known[0], received - known[-1]
    inside = np.interp(received, known, stamps)
    return inside + np.minimum(before, 0) + np.maximum(after, 0)
