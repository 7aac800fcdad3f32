"""Fisher information of a dataset about coefficients and initial motion, and the bound of Cramer and Rao."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import reduce

import numpy as np
from numpy.typing import NDArray

from auvid_cli.data.dataset import Dataset
from auvid_cli.errors import DataError
from auvid_cli.filters.information import Information
from auvid_cli.filters.problem import Belief
from auvid_cli.filters.sensitivities import responses
from auvid_cli.identification.augmented import augmented_problem
from auvid_cli.identification.timeline import PART, measuring_sensors
from auvid_cli.vehicle.coefficients import SYMBOLS
from auvid_cli.vehicle.parameters import MOTION_SYMBOLS

Array = NDArray[np.float64]

# In how many steps a run is gone through, at least: to see the bound fall, and how far it can be found at all.
_STAGES = 12
# A bound that grows by more than this with more data is rounding.
_ROUNDED = 1.05


@dataclass(frozen=True)
class DatasetInformation:
    """What the readings of a dataset say about the coefficients and the motion at the start, jointly.

    Attributes
    ----------
    state : tuple of str
        Symbols: the estimated coefficients, then the nine motion states at the first event.
    scale : ndarray, shape (n,)
        SI value of one unit of each in which the information is given: of a coefficient its prior standard deviation,
        of a motion state one.
    prior : Belief
        That a filter would start from, in the same units.
    by_sensor : dict of Information
        Of each sensor that measures motion.
    growing : tuple of (float, Information)
        Of all of them together up to some times, s, from the beginning; the whole last.
    lost_after : float or None
        s, from the beginning: what is said holds for the data up to there, because after it the sensitivities of a
        motion that is unstable in open loop differ by more than doubles can hold.
    """

    state: tuple[str, ...]
    scale: Array
    prior: Belief
    by_sensor: dict[str, Information]
    growing: tuple[tuple[float, Information], ...]
    lost_after: float | None

    @property
    def total(self) -> Information:
        """Of all sensors over the whole run."""
        return self.growing[-1][1]

    def bound(self, sensor: str | None = None) -> dict[str, float]:
        """Least standard deviation of an estimate without bias, SI, from all sensors or from one of them.

        Infinite for what the readings do not tell from the rest.
        """
        return self._deviations(self.total if sensor is None else self.by_sensor[sensor])

    def bound_with_prior(self) -> dict[str, float]:
        """The same from all sensors and the prior together, on all of the state."""
        return self._deviations(self.total.join(Information.of_belief(self.prior, self.prior.mean)))

    def _deviations(self, information: Information) -> dict[str, float]:
        deviation = self.scale * information.uncertainty().deviation(np.eye(self.scale.size))
        return dict(zip(self.state, deviation.tolist(), strict=True))


def information_at(
    dataset: Dataset, coefficients: Mapping[str, float], motion: Array | None = None
) -> DatasetInformation:
    """Fisher information at given values of the coefficients, for white measurement noise and no process noise.

    Parameters
    ----------
    dataset : Dataset
        Its settings say what is estimated, and at which values the others are held.
    coefficients : mapping
        SI, by symbol; all that are estimated, others are not looked at.
    motion : ndarray, shape (9,), optional
        At the instant at which `auvid_cli.identification.timeline.initial_motion` starts, SI; as measured by then if it
        is left out.

    Raises
    ------
    DataError
        If the model blows up with these coefficients.
    """
    busiest = max(record.time.size for record in measuring_sensors(dataset).values())
    problem = augmented_problem(dataset, min(PART, busiest // _STAGES + 1))
    if len(problem.segments) > 1:
        raise DataError("bounds are found for one stretch of data only; here are several (identification.use)")
    timelines, prior = problem.segments[0].timelines, problem.prior
    start = prior.mean.copy()
    for i, symbol in enumerate(problem.state):
        if symbol in SYMBOLS:
            start[i] = coefficients[symbol] / problem.scale[i]
    if motion is not None:
        first = problem.state.index(MOTION_SYMBOLS[0])
        start[first : first + len(motion)] = motion
    by_sensor = dict.fromkeys(problem.measuring, Information.none(start.size))
    growing: list[tuple[float, Information]] = []
    least, lost_after = np.full(start.size, np.inf), None
    for response in responses(problem.process, problem.sensors, timelines, start):
        if response.blew_up:
            time = response.timeline.time[len(response.mean)]
            raise DataError(f"with these coefficients the model blows up at t = {time:.3f} s")
        longer = {
            name: by_sensor[name].with_response(response, response.timeline.reading_sensor == sensor)
            for sensor, name in enumerate(by_sensor)
        }
        together = reduce(Information.join, longer.values())
        deviation = together.uncertainty().deviation(np.eye(start.size))
        # More data cannot say less: if it seems so, rounding has the last word.
        if (deviation > _ROUNDED * least).any():
            lost_after = growing[-1][0]
            break
        by_sensor, least = longer, deviation
        growing.append((float(response.timeline.time[-1]) - timelines.span[0], together))
    return DatasetInformation(problem.state, problem.scale, prior, by_sensor, tuple(growing), lost_after)
