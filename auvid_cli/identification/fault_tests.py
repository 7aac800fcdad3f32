"""What stands against an estimate, fault by fault, as tests of which each has a size in SI units."""

import numpy as np
from numpy.typing import NDArray

from auvid_cli.data.estimate import EstimateHeader, FaultTest
from auvid_cli.filters.problem import FaultScores, FilterOutcome, OtherAnswer

Array = NDArray[np.float64]


def fault_tests(outcome: FilterOutcome, header: EstimateHeader, scale: Array) -> tuple[FaultTest, ...]:
    """Say of each fault what the data say of it, and which coefficient it would move most.

    Parameters
    ----------
    outcome : FilterOutcome
        In scaled units.
    header : EstimateHeader
    scale : ndarray, shape (n,)
        SI value of one unit of each component of the state.
    """
    coefficients = header.coefficient_rows
    deviation = np.sqrt(np.diagonal(outcome.covariance))
    scores = [] if outcome.faults is None else _of_scores(outcome.faults, header, coefficients, deviation)
    others = (_of_other(other, header, coefficients, deviation, scale) for other in outcome.others)
    # A segment that says all that is known by itself can be compared with nothing.
    return *scores, *(test for test in others if np.isfinite(test.standard_deviation))


def _of_scores(
    faults: FaultScores, header: EstimateHeader, coefficients: list[int], deviation: Array
) -> list[FaultTest]:
    # What it is compiled from serves estimators that test for faults.
    from auvid_cli.identification.faults import ANSWERING, DELAY_FAULTS

    spread = header.experiment.identification.estimate.delay.spread
    faults = faults.besides({fault.name: spread for symbol, fault in DELAY_FAULTS.items() if symbol in header.state})
    # A fin that answers pushes looks like one that is late: what the delay of all inputs leaves of it is its own.
    not_late = faults.besides({DELAY_FAULTS["delay_inputs"].name: spread})
    tests = []
    for name, unit in zip(faults.names, faults.units, strict=True):
        own = not_late if name in ANSWERING else faults
        f = own.names.index(name)
        # A fault that leaves no trace is not tested: there is nothing to say of it.
        if own.information[f, f] > 0.0:
            moved = np.abs(own.effect[coefficients, f]) / deviation[coefficients]
            sigma, worst = float(own.information[f, f] ** -0.5), int(moved.argmax())
            symbol = header.state[coefficients[worst]]
            size = float(own.score[f]) * sigma**2
            tests.append(FaultTest(name, unit, size, sigma, symbol, float(moved[worst]) * sigma))
    return tests


def _of_other(
    other: OtherAnswer, header: EstimateHeader, coefficients: list[int], deviation: Array, scale: Array
) -> FaultTest:
    """Take the coefficient that is farthest off."""
    worst = max(coefficients, key=lambda row: abs(other.difference[row]) / other.deviation[row])
    size, sigma = (float(values[worst] * scale[worst]) for values in (other.difference, other.deviation))
    moved = float(other.moved[worst] / deviation[worst])
    return FaultTest(other.name, header.unit[worst], size, sigma, header.state[worst], moved)
