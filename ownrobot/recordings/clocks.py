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
    """The messages of one topic, in the order in which they came.

    Attributes:
        topic: its name
        received: (N,) s; 0 before a simulation's first clock
        stamps: (N,) s; None where the messages have none
        columns: name -> the messages (n,) that have it, and its values (n,)
    """

    topic: str
    received: np.ndarray
    stamps: np.ndarray | None
    columns: dict[str, tuple[np.ndarray, np.ndarray]]


def on_one_clock(topics: Sequence[Messages]) -> tuple[list[np.ndarray], list[str]]:
    """Times (N,), s, of each topic on one clock, and what must be told about it.

    A time is NaN where a message has none.
    """
    topics, notes = _with_stamps_of_one_clock(topics)
    stamped = [one for one in topics if one.stamps is not None]
    if not stamped:
        return [_known(one.received) for one in topics], notes
    reference, told = stamped[0], " ".join(notes)
    notes += filter(None, map(_lag, stamped))
    others = [one.topic for one in topics if one.stamps is None]
    names = ", ".join(sorted({name for name in others if f"{name}: " not in told}))
    if names and not _same_clock(reference):
        notes.append(
            f"{names}: without stamps, brought to the clock of those of "
            f"{reference.topic} by the times of receipt"
        )
    times = [
        one.stamps
        if one.stamps is not None
        else _to_stamps(_known(one.received), reference)
        for one in topics
    ]
    return times, notes


def _with_stamps_of_one_clock(
    topics: Sequence[Messages],
) -> tuple[list[Messages], list[str]]:
    """The topics, with those stamps that can be used, and a line about each other's."""
    usable, notes, reference = [], [], None
    for one in topics:
        fault = ""
        if one.stamps is not None:
            stamps, received, _ = _spans(one)
            if stamps < STANDING * received:
                fault = "do not grow"
            elif reference is None:
                reference = one
            else:
                expected = _to_stamps(_known(one.received), reference)
                apart = float(np.nanmedian(one.stamps - expected))
                if abs(apart) > SAME_CLOCK:
                    fault = f"are {abs(apart):.3g} s from those of {reference.topic}"
        if fault:
            notes.append(f"{one.topic}: its stamps {fault}; the times of receipt count")
        usable.append(one._replace(stamps=None) if fault else one)
    return usable, notes


def _known(received: np.ndarray) -> np.ndarray:
    """Times of receipt (N,), NaN before a simulation's first clock."""
    return np.where(received > 0, received, np.nan)


def _spans(one: Messages) -> tuple[float, float, float]:
    """Spans of stamps and of receipt, and the median lag between both, s."""
    assert one.stamps is not None
    there = one.received > 0
    if there.sum() < 2:
        return 0.0, 0.0, 0.0
    stamps, received = one.stamps[there], one.received[there]
    lag = float(np.median(received - stamps))
    return float(np.ptp(stamps)), float(np.ptp(received)), lag


def _same_clock(one: Messages) -> bool:
    """Whether the stamps of a topic and its times of receipt are of one clock."""
    stamps, received, lag = _spans(one)
    return abs(lag) < SAME_CLOCK and abs(stamps - received) <= SAME_SPAN * received


def _lag(one: Messages) -> str:
    """A line about a topic whose stamps and times of receipt differ; '' otherwise."""
    stamps, received, lag = _spans(one)
    if abs(stamps - received) > SAME_SPAN * max(stamps, received):
        return (
            f"{one.topic}: its messages span {received:.4g} s by their times of "
            f"receipt and {stamps:.4g} s by their stamps; the stamps count"
        )
    if _same_clock(one) and abs(lag) > NAMED_LAG:
        way = "after" if lag > 0 else "before"
        return (
            f"{one.topic}: its messages come {abs(lag):.2g} s {way} their stamps; the "
            "stamps count"
        )
    return ""


def _to_stamps(received: np.ndarray, reference: Messages) -> np.ndarray:
    """Times of receipt (N,) brought to the clock of another topic's stamps."""
    if _same_clock(reference):
        return received
    assert reference.stamps is not None
    there = reference.received > 0
    known, where = np.unique(reference.received[there], return_inverse=True)
    counts = np.bincount(where)
    stamps = np.bincount(where, reference.stamps[there]) / counts
    inside = np.interp(received, known, stamps)
    before, after = received - known[0], received - known[-1]
    return inside + np.minimum(before, 0) + np.maximum(after, 0)
