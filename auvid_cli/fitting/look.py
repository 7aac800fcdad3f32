"""Look at data before a search.

Data that contradict themselves are refused, and coefficients of motions that hardly vary are held at the vehicle
file's values.
"""

from typing import NamedTuple

import numpy as np

from auvid_cli.config.experiment import RunSettings
from auvid_cli.data.checks import Check
from auvid_cli.data.dataset import Dataset
from auvid_cli.errors import DataError
from auvid_cli.inspection.inspect import inspect_dataset
from auvid_cli.vehicle.coefficients import EQUATION_ROWS
from auvid_cli.vehicle.parameters import SENSORS

_MIN_FIN = np.deg2rad(1.0)  # rad, RMS about the mean
_MIN_ROLL_MOMENT = 1e-3  # N m, RMS about the mean
_MIN_NOISE_RATIO = 3.0  # RMS of a velocity, as a multiple of the noise of its sensor
# Beginnings of the names of checks that do not end a search if they fail: an addition explains what they find, it
# concerns few measurements, or the vehicle file may be wrong.
_NOT_DECISIVE = (
    "delay",
    "pitch offset",
    "spikes",
    "steps",
    "excursions",
    "stuck",
    "missing",
    "gimbal",
    "size",
    "strength",
)


def refuse_contradictions(dataset: Dataset) -> None:
    """Inspect the data, and refuse them if a sign, a unit, an axis or a clock is wrong.

    Raises
    ------
    DataError
        With the failed check and its advice.
    """
    decisive = [check for check in inspect_dataset(dataset).checks.failed() if _is_decisive(check)]
    if decisive:
        first, others = decisive[0], len(decisive) - 1
        more = f" ({others} more: auvid inspect)" if others else ""
        raise DataError(
            f"{first.subject}: {first.check}: {first.statistic}, expected {first.threshold}{more}. {first.advice} If "
            "the check is wrong, search nevertheless with --ignore-inspection"
        )


def _is_decisive(check: Check) -> bool:
    return not check.check.startswith(_NOT_DECISIVE)


class _Plane(NamedTuple):
    """Motion that an input excites."""

    name: str
    input: str
    least: float  # RMS of the input that excites it
    sensor: str  # measures the velocity
    velocity: str
    rows: str  # of the equations of motion


_PLANES = (
    _Plane("the vertical plane", "elevator", _MIN_FIN, "dvl", "w", "ZM"),
    _Plane("the horizontal plane", "rudder", _MIN_FIN, "dvl", "v", "YN"),
    _Plane("roll", "roll_moment", _MIN_ROLL_MOMENT, "gyroscope", "p", "K"),
)


def with_still_planes_held(dataset: Dataset) -> tuple[RunSettings, tuple[str, ...]]:
    """Return settings that hold the coefficients of still motions, and the names of these motions.

    A motion is still if its input hardly varies, and no sensor shows a velocity beyond its noise. Nothing is held
    unless the prior is at the vehicle file's values, and the settings estimate all coefficients.
    """
    settings = dataset.experiment
    identification, vehicle = settings.identification, settings.vehicle
    if identification.prior.mean != "vehicle" or identification.coefficients != "all":
        return settings, ()
    still = [plane for plane in _PLANES if _is_still(dataset, plane)]
    rows = {EQUATION_ROWS.index(row) for plane in still for row in plane.rows}
    of = {coefficient.symbol: coefficient for coefficient in vehicle.coefficient_set}
    estimated, stated = identification.estimated(vehicle), vehicle.stated_coefficients()
    kept = tuple(symbol for symbol in estimated if of[symbol].row not in rows or symbol not in stated)
    if not kept or len(kept) == len(estimated):
        return settings, ()
    return settings.with_identification(coefficients=kept), tuple(plane.name for plane in still)


def _is_still(dataset: Dataset, plane: _Plane) -> bool:
    inputs = dataset.inputs
    column = [quantity.symbol for quantity in inputs.quantities].index(plane.input)
    if float(inputs.values[:, column].std()) >= plane.least:
        return False
    record = dataset.sensors.get(plane.sensor)
    if record is None:
        return True
    component = [quantity.symbol for quantity in SENSORS[plane.sensor]].index(plane.velocity)
    values = record.values[:, component]
    finite = values[np.isfinite(values)]
    if not finite.size:
        return True
    size = float(np.sqrt(np.mean(np.square(finite))))
    return size < _MIN_NOISE_RATIO * float(record.standard_deviation[component])
