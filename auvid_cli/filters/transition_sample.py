"""Sample of the transitions of a chunk, for derivatives that change slowly along it."""

from typing import NamedTuple

import numpy as np

from auvid_cli.arrays import Array
from auvid_cli.filters.problem import Indices, Timeline

# Decimals of durations, s, that are different.
_DURATION_DECIMALS = 4


class TransitionSample(NamedTuple):
    """Events whose transitions represent those of a chunk, one for each interval."""

    events: Indices  # shape (k,)
    timeline: Timeline  # of the chunk, with the substeps of these events only
    driven: Indices  # shape (m,); all events with substeps
    first: Indices  # shape (k,); first of `driven` in each interval
    elapsed: Array  # shape (m,); s; duration of the substeps of each of `driven`
    of_events: Array  # shape (k,); s; that of the substeps of `events`

    @classmethod
    def of(cls, timeline: Timeline, interval: float) -> "TransitionSample":
        """Choose an event of each interval, s; all events if it is 0."""
        offset, duration = timeline.substep_offset, timeline.substep_duration
        driven = np.flatnonzero(np.diff(offset))
        elapsed = np.add.reduceat(duration, offset[driven]) if driven.size else np.zeros(0)
        number = np.floor(np.cumsum(elapsed) / interval) if interval else np.arange(driven.size)
        first = np.flatnonzero(np.diff(number, prepend=-1.0))
        chosen = _typical(elapsed, first) if first.size else first
        events = driven[chosen]
        counts = np.zeros(timeline.time.size, dtype=np.int64)
        counts[events] = np.diff(offset)[events]
        of_events = np.repeat(counts > 0, np.diff(offset))
        substeps = timeline._replace(
            substep_offset=np.concatenate([[0], np.cumsum(counts)]),
            substep_duration=duration[of_events],
            substep_input=timeline.substep_input[of_events],
        )
        return cls(events, substeps, driven, first, elapsed, elapsed[chosen])

    def sums(self, by_transition: Array) -> Array:
        """Return the sums of the gradients by transitions over intervals, shape (k, n, n).

        The derivative of a transition is proportional to its duration.
        """
        if not self.events.size:
            return by_transition[:0]
        weighted = by_transition[self.driven] * self.elapsed[:, None, None]
        return np.add.reduceat(weighted, self.first, axis=0) / self.of_events[:, None, None]


def _typical(elapsed: Array, first: Indices) -> Indices:
    """Return the event of typical duration in each group, near its middle, shape (k,)."""
    ends = np.append(first[1:], elapsed.size)
    group = np.repeat(np.arange(first.size), ends - first)
    typical = np.add.reduceat(elapsed**2, first) / np.add.reduceat(elapsed, first)
    untypical = np.round(np.abs(elapsed - typical[group]), _DURATION_DECIMALS)
    off_middle = np.abs(np.arange(elapsed.size) - (0.5 * (first + ends - 1))[group])
    return np.lexsort((off_middle, untypical, group))[first]
