"""Fisher information of a dataset about coefficients and initial motions, and the bound of Cramer and Rao."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import reduce

import numpy as np
from numpy.typing import NDArray

from auvid_cli.errors import DataError
from auvid_cli.filters.least_squares import Information, join_segments
from auvid_cli.filters.problem import Gaussian
from auvid_cli.filters.sensitivities import responses
from auvid_cli.identification.prepared_data import PreparedData, Segment
from auvid_cli.identification.problem_setup import AugmentedProblem, augmented_problem
from auvid_cli.identification.timeline import CHUNK

Array = NDArray[np.float64]

# In how many steps a run is gone through, at least: to see the bound fall, and how far it can be found at all.
_STAGES = 12
# A bound that grows by more than this with more data is rounding.
_ROUNDED = 1.05


@dataclass(frozen=True)
class DatasetInformation:
    """What the measurements of a dataset say of the coefficients and the motion at the start of each segment, jointly.

    Attributes
    ----------
    state : tuple of str
        Symbols: the estimated coefficients, then the nine motion states at the first event of a segment.
    scale : ndarray, shape (n,)
        SI value of one unit of each in which the information is given: of a coefficient its prior standard deviation,
        of a motion state one.
    prior : Gaussian
        That a filter would start from, in the same units, about the joint state of the segments.
    by_sensor : dict of Information
        Of each sensor that measures motion, about the joint state, see `auvid_cli.filters.problem`.
    total : Information
        Of all sensors.
    growing : tuple of (float, Information)
        Of all of them together after so many seconds of data, about the state of the segment that these reach; the
        whole last.
    lost_after : float or None
        s: what is said holds for so much of the data, because after it the sensitivities of a motion that is unstable
        in open loop differ by more than doubles can hold.
    """

    state: tuple[str, ...]
    scale: Array
    prior: Gaussian
    by_sensor: dict[str, Information]
    total: Information
    growing: tuple[tuple[float, Information], ...]
    lost_after: float | None

    def bound(self, sensor: str | None = None) -> dict[str, float]:
        """Return the least standard deviation of an estimate without bias, SI, from all sensors or from one of them.

        Infinite for what the measurements do not tell from the rest.
        """
        return self._deviations(self.total if sensor is None else self.by_sensor[sensor])

    def bound_with_prior(self) -> dict[str, float]:
        """Return the same from all sensors and the prior together, on all of the state."""
        return self._deviations(self.total.join(Information.of_gaussian(self.prior, self.prior.mean)))

    def _deviations(self, information: Information) -> dict[str, float]:
        """Return the bound on the coefficients and on the first motion."""
        first = np.eye(self.scale.size, information.projected.size)
        deviation = self.scale * information.uncertainty().deviation(first)
        return dict(zip(self.state, deviation.tolist(), strict=True))


def information_at(
    prepared: PreparedData,
    coefficients: Mapping[str, float],
    motions: Sequence[Array] | None = None,
    along: Callable[[Array], Array] | None = None,
) -> DatasetInformation:
    """Find the Fisher information at some coefficients, for white measurement noise and no process noise.

    Parameters
    ----------
    prepared : PreparedData
        Its settings say what is estimated, and at which values the others are held.
    coefficients : mapping
        SI, by symbol; all that are estimated, others are not looked at.
    motions : sequence of ndarray, shape (9,), optional
        At the instant at which each segment starts, see `PreparedData`, SI; as measured
        by then if they are left out.
    along : callable, optional
        From times to the motion that the coefficients lead to, shape (n, 9), SI, about which each step is linearised;
        without it about the motion left to itself, which one that is unstable leaves by rounding.

    Raises
    ------
    DataError
        If the model blows up with these coefficients.
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
            known = _together(longer).join(before)
            deviation = known.uncertainty().deviation(np.eye(n))
            # More data cannot say less: if it seems so, rounding has the last word.
            if (deviation > _ROUNDED * least).any():
                lost_after = growing[-1][0]
                break
            by_sensor, least = longer, deviation
            growing.append((elapsed + time - segment.timelines.span[0], known))
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
    """Yield what each sensor says of the state of a segment until later and later, s, as the motion goes on."""
    busiest = max(record.time.size for record in problem.measuring.values())
    timelines = segment.timelines.in_chunks_of(min(CHUNK, busiest // _STAGES + 1))
    by_sensor = dict.fromkeys(problem.measuring, Information.empty(start.size))
    for response in responses(problem.process, problem.sensors, timelines, start, path):
        time, measured_by = response.timeline.time, response.timeline.measurement_sensor
        if response.diverged:
            raise DataError(f"with these coefficients the model blows up at t = {time[len(response.mean)]:.3f} s")
        by_sensor = {
            name: information.with_response(response, measured_by == sensor)
            for sensor, (name, information) in enumerate(by_sensor.items())
        }
        yield float(time[-1]), by_sensor


def _together(by_sensor: Mapping[str, Information]) -> Information:
    return reduce(Information.join, by_sensor.values())


def _start(problem: AugmentedProblem, coefficients: Mapping[str, float], motions: Sequence[Array] | None) -> Array:
    """Return the joint state in scaled units; what is not given is as the prior has it."""
    start = problem.prior.mean.copy()
    rows = problem.layout.rows_of("coefficients")
    start[rows] = [coefficients[symbol] for symbol in problem.layout.symbols[rows]] / problem.layout.scale[rows]
    if motions is not None:
        for motion, place in zip(motions, problem.places, strict=True):
            start[place[problem.layout.rows_of("motion")]] = motion
    return start
