"""Tests of an estimate for faults, and against alternative estimates, with sizes in SI units."""

import numpy as np
from numpy.typing import NDArray

from auvid_cli.data.estimate import EstimateHeader
from auvid_cli.data.faults import Fault, FaultKind, FaultTest
from auvid_cli.filters.problem import AlternativeEstimate, FaultScores, FilterOutcome

Array = NDArray[np.float64]


def fault_tests(outcome: FilterOutcome, header: EstimateHeader, scale: Array) -> tuple[FaultTest, ...]:
    """Return the test of each fault that leaves a trace in the data, and of each alternative estimate.

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
    # The difference from a segment that alone has all information has no variance.
    return *scores, *(test for test in others if np.isfinite(test.standard_deviation))


def _of_scores(
    faults: FaultScores, header: EstimateHeader, coefficients: list[int], deviation: Array
) -> list[FaultTest]:
    spread = header.experiment.identification.estimate.delay.spread
    delays = [model for model in faults.labels if model.fault.kind in (FaultKind.INPUT_DELAY, FaultKind.SENSOR_DELAY)]
    faults = faults.conditional_on({model: spread for model in delays if model.state in header.state})
    # A fin that anticipates looks like one that is late: only what the delay of all inputs leaves is attributed to it.
    not_late = faults.conditional_on({model: spread for model in delays if not model.sensor})
    tests = []
    for model in faults.labels:
        own = not_late if model.answers else faults
        f = own.labels.index(model)
        # A fault that leaves no trace is not tested.
        if own.information[f, f] > 0.0:
            moved = np.abs(own.effect[coefficients, f]) / deviation[coefficients]
            sigma, worst = float(own.information[f, f] ** -0.5), int(moved.argmax())
            symbol = header.state[coefficients[worst]]
            size = float(own.score[f]) * sigma**2
            tests.append(FaultTest(model.fault, model.unit, size, sigma, symbol, float(moved[worst]) * sigma))
    return tests


def _of_other(
    other: AlternativeEstimate, header: EstimateHeader, coefficients: list[int], deviation: Array, scale: Array
) -> FaultTest:
    """Compare the coefficient that differs most."""
    worst = max(coefficients, key=lambda row: abs(other.difference[row]) / other.deviation[row])
    size, sigma = (float(values[worst] * scale[worst]) for values in (other.difference, other.deviation))
    moved = float(other.moved[worst] / deviation[worst])
    if other.begin is None:
        fault = Fault(FaultKind.ANOTHER_MINIMUM, f"{other.cost_increase:.3g}")
    else:
        fault = Fault(FaultKind.SEGMENT, f"{other.begin:g}")
    return FaultTest(fault, header.unit[worst], size, sigma, header.state[worst], moved)
