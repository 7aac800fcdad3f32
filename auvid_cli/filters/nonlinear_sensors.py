"""What nonlinear sensors say along a motion: residuals, and how what is predicted depends on the state."""

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.filters.measurement import wrapped
from auvid_cli.filters.problem import Process, Sensors, Timeline

Array = NDArray[np.float64]


class LinearisedMeasurement(NamedTuple):
    """A measurement of a nonlinear sensor about a state.

    Attributes
    ----------
    k, event : int
        Its row in the timeline, and the event that it belongs to.
    residual : ndarray, shape (c,)
        Measured less predicted, angles wrapped; NaN where missing.
    derivative : ndarray, shape (c, n)
        Of what is predicted.
    """

    k: int
    event: int
    residual: Array
    derivative: Array


def linearised_measurements(
    process: Process, sensors: Sensors, timeline: Timeline, n_events: int, state_at: Callable[[int], Array]
) -> Iterator[LinearisedMeasurement]:
    """Linearise the measurements of the nonlinear sensors at the first events of a timeline.

    Parameters
    ----------
    process, sensors, timeline
        See `auvid_cli.filters.problem`.
    n_events : int
    state_at : callable
        The state, shape (n,), at an event.
    """
    event = np.repeat(np.arange(n_events), np.diff(timeline.measurement_offset[: n_events + 1]))
    for k in np.flatnonzero(sensors.nonlinear[timeline.measurement_sensor[: event.size]]).tolist():
        assert process.linearise is not None, "a nonlinear sensor needs `Process.linearise`"
        sensor, place = int(timeline.measurement_sensor[k]), int(event[k])
        predicted, derivative = process.linearise(state_at(place), sensor)
        differences = timeline.measurement[k, : predicted.size] - predicted
        residual = np.array([wrapped(*pair) for pair in zip(differences, sensors.angular[sensor], strict=False)])
        yield LinearisedMeasurement(k, place, residual, derivative)
