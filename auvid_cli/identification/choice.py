"""The estimator that settings name, for an augmented problem."""

from functools import partial
from typing import assert_never

import numpy as np
from numpy.typing import NDArray

from auvid_cli.config.experiment import Identification
from auvid_cli.config.filter_name import FilterName
from auvid_cli.filters.estimators import Estimator, IteratedSmoother, KalmanFilter, OutputErrorMethod
from auvid_cli.filters.point_sets import PointSet, cubature, transformed, unscented
from auvid_cli.filters.square_root import run_square_root_filter
from auvid_cli.identification.augmented import AugmentedProblem
from auvid_cli.identification.process import first_order_transition

Array = NDArray[np.float64]


def chosen_estimator(name: FilterName, augmented: AugmentedProblem, settings: Identification) -> Estimator:
    """Set up an estimator.

    Parameters
    ----------
    name : FilterName
    augmented : AugmentedProblem
    settings : Identification
    """
    n = len(augmented.layout.symbols)
    match name:
        case FilterName.EKF:
            return _extended(augmented, settings)
        case FilterName.CKF:
            return _sigma_point(name, augmented, cubature(n))
        case FilterName.TUKF:
            return _sigma_point(name, augmented, transformed(n))
        case FilterName.UKF:
            points = unscented(n, settings.ukf.alpha, settings.ukf.beta, settings.ukf.kappa)
            return _sigma_point(name, augmented, points)
        case FilterName.SMOOTHER:
            return _smoother(augmented, settings)
        case FilterName.OUTPUT_ERROR:
            method = settings.output_error
            bounds = _bounds(augmented, method.bounds)
            problem = augmented.process, augmented.sensors
            return OutputErrorMethod(name.value, *problem, method.max_evaluations, bounds, method.use_prior)
        case _:
            assert_never(name)


def _extended(augmented: AugmentedProblem, settings: Identification) -> KalmanFilter:
    # filterpy is slow to load and large, and no other filter needs it.
    from auvid_cli.filters.extended import run_extended_filter

    process = augmented.process
    if settings.ekf.transition == "first_order":
        process = process._replace(transition=first_order_transition)
    return KalmanFilter(FilterName.EKF.value, process, augmented.sensors, run_extended_filter)


def _smoother(augmented: AugmentedProblem, settings: Identification) -> IteratedSmoother:
    # What it is compiled from serves no other estimator.
    from auvid_cli.identification.faults import VehicleFaults

    problem = augmented.process, augmented.sensors, settings.smoother.max_passes
    return IteratedSmoother(FilterName.SMOOTHER.value, *problem, VehicleFaults(augmented))


def _sigma_point(name: FilterName, augmented: AugmentedProblem, points: PointSet) -> KalmanFilter:
    return KalmanFilter(name.value, augmented.process, augmented.sensors, partial(run_square_root_filter, points))


def _bounds(augmented: AugmentedProblem, intervals: dict[str, tuple[float, float]]) -> tuple[Array, Array]:
    """Return lower and upper bounds of the scaled joint state, of which coefficients may have some."""
    lower, upper = np.full(augmented.prior.mean.size, -np.inf), np.full(augmented.prior.mean.size, np.inf)
    for symbol, limits in intervals.items():
        (place,) = augmented.layout.rows([symbol])
        lower[place], upper[place] = np.array(limits) / augmented.layout.scale[place]
    return lower, upper
