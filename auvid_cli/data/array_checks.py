"""Checks of arrays: type, shape, order of times, plausible values. Each raises an InvalidDataError."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from auvid_cli.arrays import Array
from auvid_cli.config.units import magnitude_of
from auvid_cli.errors import InvalidDataError
from auvid_cli.vehicle.parameters import SENSORS

MAX_TIME = 1e8  # s, from the beginning of the data: three years
# Limits of a standard deviation, within which its square and the inverse of its square are finite.
_SIZES = 1e-100, 1e100


def check_type(where: str, value: object, expected: type) -> None:
    """Check that a value is an instance of a class."""
    if not isinstance(value, expected):
        raise InvalidDataError(f"{where}: expected {expected.__name__}, got {type(value).__name__}")


def real_array(where: str, value: Any, ndim: int) -> Array:
    """Return an array of doubles; lists of real numbers are accepted, but no masked, complex or other values."""
    if isinstance(value, np.ma.MaskedArray):
        raise InvalidDataError(f"{where}: expected an array without mask; replace masked values by NaN")
    try:
        array = np.asarray(value)
    except (TypeError, ValueError):
        raise InvalidDataError(f"{where}: expected real numbers, got rows of different lengths") from None
    if array.dtype.kind not in "iuf":
        raise InvalidDataError(f"{where}: expected real numbers, got {_kind_of(value, array)}")
    if array.ndim != ndim:
        raise InvalidDataError(
            f"{where}: expected {ndim} {'dimension' if ndim == 1 else 'dimensions'}, got {array.ndim}"
        )
    # Compiled functions accept only contiguous, writable arrays.
    return np.require(array, np.float64, ["C", "W"])


def put_arrays(record: object, where: str, **dimensions: int) -> None:
    """Replace fields of a frozen record by arrays of doubles with these numbers of dimensions."""
    for name, ndim in dimensions.items():
        object.__setattr__(record, name, real_array(f"{where}/{name}", getattr(record, name), ndim))


def _kind_of(value: Any, array: NDArray[Any]) -> str:
    return array.dtype.name if isinstance(value, np.ndarray) and array.dtype.kind != "O" else type(value).__name__


def check_sensor(name: object) -> None:
    """Check that a sensor is known."""
    if name not in SENSORS:
        raise InvalidDataError(f"unknown sensor {name!r}; expected one of {', '.join(SENSORS)}")


def check_times(where: str, time: Array, increasing: bool = False) -> None:
    """Check that times are finite, not too late, and in order."""
    if not (np.abs(time) <= MAX_TIME).all():
        raise InvalidDataError(f"{where}: times are not finite, or later than {MAX_TIME:.0e} s")
    steps = np.diff(time)
    if (steps <= 0.0 if increasing else steps < 0.0).any():
        raise InvalidDataError(f"{where}: times are not {'strictly increasing' if increasing else 'in order'}")


def check_shapes(where: str, *expected: tuple[NDArray, tuple[int, ...]]) -> None:
    """Check that arrays have their expected shapes."""
    for array, shape in expected:
        if array.shape != shape:
            raise InvalidDataError(f"{where}: variables differ in length: expected shape {shape}, got {array.shape}")


def check_finite(where: str, *arrays: Array) -> None:
    """Check that no value is infinite or NaN."""
    if not all(np.isfinite(array).all() for array in arrays):
        raise InvalidDataError(f"{where} has values that are not finite")


def check_magnitude(where: str, values: Array, unit: str) -> None:
    """Check that no value exceeds the plausible maximum of its unit; NaN and infinity are missing values."""
    limit = magnitude_of(unit).largest
    sizes = np.abs(values)
    largest = float(np.fmax.reduce(sizes, initial=0.0))
    if largest == np.inf:
        largest = float(sizes[np.isfinite(sizes)].max(initial=0.0))
    if largest > limit:
        raise InvalidDataError(f"{where} has {largest:.9g} {unit}, more than the plausible maximum of {limit:g} {unit}")


def check_noise(where: str, deviations: Array, unit: str) -> None:
    """Check that standard deviations of a sensor are 0, or within the limits of the settings."""
    check_deviations(where, deviations)
    check_magnitude(f"{where}/standard_deviation", deviations, unit)
    least = magnitude_of(unit).smallest
    if ((deviations > 0.0) & (deviations < least)).any():
        raise InvalidDataError(
            f"{where}/standard_deviation has {deviations.min():g} {unit}, less than {least:g} {unit}"
        )


def check_deviations(where: str, deviations: Array, may_be_infinite: bool = False) -> None:
    """Check that standard deviations are finite and not negative."""
    if not (deviations >= 0.0).all() or not (may_be_infinite or np.isfinite(deviations).all()):
        raise InvalidDataError(f"{where}: standard deviations are negative or not finite")


def check_range(where: str, deviations: Array) -> None:
    """Check that finite standard deviations are 0, or neither too large nor too small for their squares."""
    sizes = deviations[np.isfinite(deviations) & (deviations != 0.0)]
    if ((sizes < _SIZES[0]) | (sizes > _SIZES[1])).any():
        raise InvalidDataError(f"{where}: standard deviations are too large or too small to compute with")
