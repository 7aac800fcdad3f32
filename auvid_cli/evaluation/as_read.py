"""What sensors read of a motion, with the errors and the current that a filter found."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.identification.biases import DVL_ERRORS
from auvid_cli.logs.frames import earth_to_body
from auvid_cli.vehicle.parameters import MOTION_SYMBOLS

Array = NDArray[np.float64]


class ReadingErrors(NamedTuple):
    """Why readings of a motion are not that motion; zero where no filter looked.

    Attributes
    ----------
    offset : ndarray, shape (9,)
        Adds to the readings of each motion state, SI.
    dvl : ndarray, shape (4,)
        Scale error of the DVL, its mounting yaw, rad, and the current that carries it over ground, north and east, m/s.
    """

    offset: Array
    dvl: Array


def found_errors(state: Sequence[str], values: Array) -> ReadingErrors:
    """Those among the components of a state, shape (len(state),)."""
    known = dict(zip(state, values, strict=True))
    return ReadingErrors(
        np.array([known.get(f"bias_{symbol}", 0.0) for symbol in MOTION_SYMBOLS]),
        np.array([known.get(symbol, 0.0) for symbol in DVL_ERRORS]),
    )


def as_read(motion: Array, errors: ReadingErrors) -> Array:
    """What noiseless sensors would say of a motion.

    ``(1 + scale) Rz(yaw)' ([u v w] + R(phi, theta, psi)' [current_north current_east 0])`` for the velocity.

    Parameters
    ----------
    motion : ndarray, shape (..., 9)
        Its velocity is that through the water; not finite where a model blew up.
    errors : ReadingErrors

    Returns
    -------
    ndarray, shape (..., 9)
        Its velocity is that over ground.
    """
    read = motion + errors.offset
    with np.errstate(invalid="ignore", over="ignore"):
        over_ground = motion[..., :3] + _drift(motion[..., 6:], errors)
        read[..., :3] = over_ground @ _turn(errors).T + errors.offset[:3]
    return read


def behind_reading(reading: Array, errors: ReadingErrors) -> Array:
    """The motion, shape (..., 9), of which noiseless sensors would say this: the inverse of `as_read`."""
    motion = reading - errors.offset
    motion[..., :3] = motion[..., :3] @ np.linalg.inv(_turn(errors)).T - _drift(motion[..., 6:], errors)
    return motion


def _turn(errors: ReadingErrors) -> Array:
    """From the velocity over ground to that along the axes of the DVL."""
    scale, yaw, *_ = errors.dvl
    sine, cosine = np.sin(yaw), np.cos(yaw)
    return (1.0 + scale) * np.array([[cosine, sine, 0.0], [-sine, cosine, 0.0], [0.0, 0.0, 1.0]])


def _drift(attitude: Array, errors: ReadingErrors) -> Array:
    """The current along x, y, z of the vehicle, shape (..., 3)."""
    *_, north, east = errors.dvl
    rows = attitude.reshape(-1, 3)
    return earth_to_body(rows, np.broadcast_to([north, east, 0.0], rows.shape)).reshape(attitude.shape)
