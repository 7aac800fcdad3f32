"""Fisher information of a dataset about coefficients and initial motions, and the Cramer-Rao bound."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import reduce

import numpy as np

from auvid_cli.arrays import Array
from auvid_cli.errors import DataError
from auvid_cli.filters.least_squares import Information, join_segments
from auvid_cli.filters.problem import Gaussian
from auvid_cli.filters.sensitivities import responses
from auvid_cli.identification.prepared_data import PreparedData, Segment
from auvid_cli.identification.problem_setup import AugmentedProblem, augmented_problem
from auvid_cli.identification.timeline import CHUNK

# Least number of stages of a segment at which the bound is computed.
_MIN_STAGES = 12
# Growth of a bound with more data, as a factor, above which rounding errors dominate it.
_ROUNDING_FACTOR = 1.05


@dataclass(frozen=True)
class DatasetInformation:
    """Fisher information of a dataset about the coefficients and the initial motion of each segment."""

    state: tuple[str, ...]  # symbols: the parameters, then the moving states at the first event of a segment
    scale: Array  # shape (n,); SI value of one unit of each component in which the information is given
    prior: Gaussian  # prior of the joint state of the segments, in the same units
    by_sensor: dict[str, Information]  # from each sensor, about the joint state, see `auvid_cli.filters.problem`
    total: Information  # from all sensors
    # Duration of the data so far, s, and information from all sensors about the state of the current segment
    growing: tuple[tuple[float, Information], ...]
    # Duration of the used data, s, if the sensitivities of an unstable motion exceed double precision later; else None
    lost_after: float | None

    def bound(self, sensor: str | None = None) -> dict[str, float]:
        """Return the Cramer-Rao bound on standard deviations by symbol, SI, from all sensors or one.

        It is infinite for a component that is not observable.
        """
        return self._deviations(self.total if sensor is None else self.by_sensor[sensor])

    def bound_with_prior(self) -> dict[str, float]:
        """Return the bound from all sensors and the prior together by symbol, SI."""
        return self._deviations(self.total.join(Information.of_gaussian(self.prior, self.prior.mean)))

    def _deviations(self, information: Information) -> dict[str, float]:
        """Return the bound on the parameters and on the moving states of the first segment."""
        first = np.eye(self.scale.size, information.projected.size)
        deviation = self.scale * information.uncertainty().deviation(first)
        return dict(zip(self.state, deviation.tolist(), strict=True))


def information_at(
    prepared: PreparedData,
    coefficients: Mapping[str, float],
    motions: Sequence[Array] | None = None,
    along: Callable[[Array], Array] | None = None,
) -> DatasetInformation:
    """Return the Fisher information at given coefficients, for white measurement noise and no process noise.

    Parameters
    ----------
    prepared : PreparedData
    coefficients : mapping
        Values of all estimated coefficients by symbol, SI.
    motions : sequence of ndarray, shape (9,), optional
        Initial motion of each segment, SI; by default as measured.
    along : callable, optional
        Function from times to motions, shape (n, 9), SI, about which each step is linearised. By default about the free
        motion, in which rounding errors of an unstable vehicle grow.

    Raises
    ------
    DataError
        If the simulated motion diverges with these coefficients.
    """
    problem = augmented_problem(prepared)
    start, n = _start(problem, coefficients, motions), len(problem.layout.symbols)
    n_parameters = problem.layout.n_parameters
    by_segment: list[dict[str, Information]] = []
    growing: list[tuple[float, Information]] = []
    elapsed, before, lost_after = 0.0, Information.empty(n), None
    least = np.full(n, np.inf)

    def path(times: Array) -> Array:
        states = np.full((times.size, n - n_parameters), np.nan)
        if along is not None:
            states[:, problem.layout.moving_rows_of("motion")] = along(times)
        return states

    for segment, place in zip(problem.segments, problem.places, strict=True):
        by_sensor = dict.fromkeys(problem.measuring, Information.empty(n))
        least[n_parameters:] = np.inf
        for time, longer in _stages(problem, segment, start[place], path):
            information = _together(longer).join(before)
            deviation = information.uncertainty().deviation(np.eye(n))
            # The bound cannot grow with more data, except by rounding.
            if (deviation > _ROUNDING_FACTOR * least).any():
                lost_after = growing[-1][0]
                break
            by_sensor, least = longer, deviation
            growing.append((elapsed + time - segment.timelines.span[0], information))
        by_segment.append(by_sensor)
        if lost_after is not None:
            break
        elapsed, before = growing[-1][0], before.join(_together(by_sensor).split(n_parameters)[1])
    reached = n_parameters + len(by_segment) * (n - n_parameters)
    return DatasetInformation(
        problem.layout.symbols,
        problem.layout.scale,
        Gaussian(problem.prior.mean[:reached], problem.prior.factor[:reached, :reached]),
        {
            name: join_segments([by_sensor[name] for by_sensor in by_segment], n_parameters)
            for name in problem.measuring
        },
        join_segments([_together(by_sensor) for by_sensor in by_segment], n_parameters),
        tuple(growing),
        lost_after,
    )


def _stages(
    problem: AugmentedProblem, segment: Segment, start: Array, path: Callable[[Array], Array]
) -> Iterator[tuple[float, dict[str, Information]]]:
    """Yield times, s, and the information from each sensor about the state of a segment up to these."""
    most_samples = max(record.time.size for record in problem.measuring.values())
    timelines = segment.timelines.in_chunks_of(min(CHUNK, most_samples // _MIN_STAGES + 1))
    by_sensor = dict.fromkeys(problem.measuring, Information.empty(start.size))
    for response in responses(problem.process, problem.sensors, timelines, start, path):
        time, measured_by = response.timeline.time, response.timeline.measurement_sensor
        if response.diverged:
            raise DataError(f"with these coefficients the motion diverges at t = {time[len(response.mean)]:.3f} s")
        by_sensor = {
            name: information.with_response(response, measured_by == sensor)
            for sensor, (name, information) in enumerate(by_sensor.items())
        }
        yield float(time[-1]), by_sensor


def _together(by_sensor: Mapping[str, Information]) -> Information:
    return reduce(Information.join, by_sensor.values())


def _start(problem: AugmentedProblem, coefficients: Mapping[str, float], motions: Sequence[Array] | None) -> Array:
    """Return the joint state in scaled units, with the prior mean of components that are not given."""
    start = problem.prior.mean.copy()
    rows = problem.layout.rows_of("coefficients")
    start[rows] = [coefficients[symbol] for symbol in problem.layout.symbols[rows]] / problem.layout.scale[rows]
    if motions is not None:
        for motion, place in zip(motions, problem.places, strict=True):
            start[place[problem.layout.rows_of("motion")]] = motion
    return start
