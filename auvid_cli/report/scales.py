"""Units in which pages and figures show quantities."""

from typing import NamedTuple

import numpy as np

from auvid_cli.report.notation import unit_text
from auvid_cli.vehicle.parameters import Quantity


class Scale(NamedTuple):
    """A unit, and how many of it an SI unit is."""

    unit: str
    factor: float


_DEGREES = float(np.rad2deg(1.0))
_READABLE = {"rad": Scale("°", _DEGREES), "rad/s": Scale("°/s", _DEGREES), "T": Scale("µT", 1e6)}


def scale_of(quantity: Quantity) -> Scale:
    """Return the unit in which a quantity is shown: angles and rates in degrees."""
    return _READABLE.get(quantity.unit, Scale(unit_text(quantity.unit), 1.0))
