"""The estimator that settings name, for an augmented problem."""

from typing import assert_never

import numpy as np
from numpy.typing import NDArray

from auvid_cli.config.filter_name import FilterName
from auvid_cli.config.identification import Identification
from auvid_cli.filters.estimators import (
    Estimator,
    ExtendedKalmanFilter,
    IteratedSmoother,
    OutputErrorMethod,
    SigmaPointFilter,
)
from auvid_cli.filters.point_sets import cubature, transformed, unscented
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
    n, problem = len(augmented.layout.symbols), (augmented.process, augmented.sensors)
    match name:
        case FilterName.EKF:
            process, sensors = problem
            if settings.ekf.transition == "first_order":
                process = process._replace(transition=first_order_transition)
            return ExtendedKalmanFilter(name.value, process, sensors)
        case FilterName.CKF:
            return SigmaPointFilter(name.value, *problem, cubature(n))
        case FilterName.TUKF:
            return SigmaPointFilter(name.value, *problem, transformed(n))
        case FilterName.UKF:
            points = unscented(n, settings.ukf.alpha, settings.ukf.beta, settings.ukf.kappa)
            return SigmaPointFilter(name.value, *problem, points)
        case FilterName.SMOOTHER:
            # What it is compiled from serves no other estimator.
            from auvid_cli.identification.fault_effects import VehicleFaults

            if settings.is_marginal:
                import auvid_cli.filters.marginal  # noqa: F401  # Compiled here, and not while filters run.
            sought = [block.name for block in settings.estimate.blocks() if block.shifts]
            own = settings.smoother.max_passes, VehicleFaults(augmented, sought), settings.is_marginal
            return IteratedSmoother(name.value, *problem, *own)
        case FilterName.OUTPUT_ERROR:
            method = settings.output_error
            bounds = _bounds(augmented, method.bounds)
            return OutputErrorMethod(name.value, *problem, method.max_evaluations, bounds, method.use_prior)
        case _:
            assert_never(name)


def _bounds(augmented: AugmentedProblem, intervals: dict[str, tuple[float, float]]) -> tuple[Array, Array]:
    """Return lower and upper bounds of the scaled joint state, of which coefficients may have some."""
    lower, upper = np.full(augmented.prior.mean.size, -np.inf), np.full(augmented.prior.mean.size, np.inf)
    for symbol, limits in intervals.items():
        (place,) = augmented.layout.rows([symbol])
        lower[place], upper[place] = np.array(limits) / augmented.layout.scale[place]
    return lower, upper
