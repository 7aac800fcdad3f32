"""What sensors read of a motion, with the errors and the current that a filter found."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.config.extra_states import ERROR_BLOCKS
from auvid_cli.identification.dvl import VELOCITY_ERRORS, measured_velocity, velocity_behind
from auvid_cli.vehicle.parameters import MOTION_AND_DEPTH_SYMBOLS, SENSORS, state_of

Array = NDArray[np.float64]

# What is measured of which motion state an error adds to, and how the velocity is measured over ground.
_ADDED = {
    quantity.symbol: state_of(measured)
    for block in ERROR_BLOCKS
    if block.additive and block.sensor is not None
    for quantity, measured in zip(block.quantities, SENSORS[block.sensor], strict=True)
}


class MeasurementErrors(NamedTuple):
    """Errors between a motion and the measurements of it; zero where no filter looked.

    Attributes
    ----------
    offset : ndarray, shape (10,)
        Adds to the measurements of each motion state and of the depth, SI.
    dvl : ndarray, shape (7,)
        Those of `VELOCITY_ERRORS`, SI.
    """

    offset: Array
    dvl: Array


def estimated_errors(state: Sequence[str], values: Array) -> MeasurementErrors:
    """Pick them from the components of a state, shape (len(state),)."""
    by_symbol = dict(zip(state, values, strict=True))
    offset = {_ADDED[symbol]: value for symbol, value in by_symbol.items() if symbol in _ADDED}
    return MeasurementErrors(
        np.array([offset.get(symbol, 0.0) for symbol in MOTION_AND_DEPTH_SYMBOLS]),
        np.array([by_symbol.get(symbol, 0.0) for symbol in VELOCITY_ERRORS]),
    )


def measured_motion(motion: Array, errors: MeasurementErrors) -> Array:
    """Return what noiseless sensors would say of a motion.

    Of the velocity a DVL, see `auvid_cli.identification.dvl`.

    Parameters
    ----------
    motion : ndarray, shape (..., 9) or (..., 10)
        Its velocity is that through the water; not finite where a model blew up; the depth behind it, or not.
    errors : MeasurementErrors

    Returns
    -------
    ndarray, shape (..., 9) or (..., 10)
        Its velocity is that over ground.
    """
    read = motion + errors.offset[: motion.shape[-1]]
    with np.errstate(invalid="ignore", over="ignore"):
        read[..., :3] = measured_velocity(motion, errors.dvl) + errors.offset[:3]
    return read


def motion_behind(measurement: Array, errors: MeasurementErrors) -> Array:
    """Return the motion of which noiseless sensors would say this; inverts `measured_motion`."""
    motion = measurement - errors.offset[: measurement.shape[-1]]
    motion[..., :3] = velocity_behind(motion, errors.dvl)
    return motion
