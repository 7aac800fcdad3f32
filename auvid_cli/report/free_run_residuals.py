"""What a free run leaves of measurements."""

import numpy as np
from numpy.typing import NDArray

from auvid_cli.angles import wrap
from auvid_cli.evaluation.predicted_motion import FreeRun
from auvid_cli.vehicle.parameters import MOTION_AND_DEPTH_SYMBOLS, Quantity, state_of

Array = NDArray[np.float64]


def free_run_residual(quantity: Quantity, time: Array, measured: Array, run: FreeRun) -> Array | None:
    """Return measurements minus a free run, SI; None where that has no such motion.

    Parameters
    ----------
    quantity : Quantity
        Component of a sensor.
    time, measured : ndarray, shape (n,)
    run : FreeRun

    Returns
    -------
    ndarray, shape (n,), or None
        NaN outside of the run and where it is not finite; angles between -pi and pi.
    """
    state = state_of(quantity)
    if state not in MOTION_AND_DEPTH_SYMBOLS or run.time.size < 2:
        return None
    column = MOTION_AND_DEPTH_SYMBOLS.index(state)
    if column >= run.motion.shape[1]:
        return None
    left = measured - interpolated(time, run, column)
    return wrap(left) if quantity.unit == "rad" else left


def interpolated(time: Array, run: FreeRun, column: int) -> Array:
    """Return a motion state of a free run at other times, s; NaN outside of it and where it is not finite."""
    finite = np.isfinite(run.motion[:, column])
    values = np.where(finite, run.motion[:, column], 0.0)
    if MOTION_AND_DEPTH_SYMBOLS[column] in ("phi", "theta", "psi"):
        values = np.unwrap(values)
    result = np.interp(time, run.time, values, left=np.nan, right=np.nan)
    # Between two samples one of which is not finite nothing is known.
    return np.where(np.interp(time, run.time, finite.astype(np.float64)) == 1.0, result, np.nan)
