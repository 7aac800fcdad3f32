"""Numbers by which loggers mark a missing measurement."""

from collections.abc import Collection, Mapping

import numpy as np
from numpy.typing import NDArray

from auvid_cli.arrays import Array

# Usual codes without their sign; 32.768 is the smallest 16-bit number in mm, written in m.
_CODES = (32.768, 999.0, 9999.0, 32768.0, 99999.0)
_MAX_OTHERS = 0.9  # largest other number divided by the code
_PRECISION = 1e-6  # of numbers stored in single precision
_MAX_ZEROS = 0.9  # share of rows of zeros


def is_code(numbers: Array, codes: Collection[float]) -> NDArray[np.bool_]:
    """Return whether numbers are one of the codes, to single precision."""
    found = np.zeros(numbers.shape, np.bool_)
    for code in codes:
        found |= np.isclose(numbers, code, rtol=_PRECISION, atol=_PRECISION)
    return found


def find_codes(numbers: Mapping[str, Array]) -> tuple[float, ...]:
    """Return the codes for missing measurements in the columns of a sensor: usual ones, far from all other numbers."""
    signed = [sign * code for code in _CODES for sign in (-1.0, 1.0)]
    codes = set[float]()
    for values in numbers.values():
        own = [code for code in signed if is_code(values, [code]).any()]
        others = np.abs(values[np.isfinite(values) & ~is_code(values, own)])
        codes |= {code for code in own if others.size and others.max() < _MAX_OTHERS * abs(code)}
    return tuple(sorted(codes))


def rows_of_zeros(numbers: Mapping[str, Array]) -> NDArray[np.bool_]:
    """Return the rows in which all components are exactly zero, as of a DVL without bottom lock."""
    return np.all([values == 0.0 for values in numbers.values()], axis=0)


def has_rows_of_zeros(numbers: Mapping[str, Array]) -> bool:
    """Whether exact zeros in all of several components mark missing measurements: some rows, but not most."""
    zeros = rows_of_zeros(numbers)
    return len(numbers) > 1 and bool(zeros.any()) and float(zeros.mean()) < _MAX_ZEROS
