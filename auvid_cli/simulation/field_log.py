"""A simulated run in the form of logs from the field, for practice.

Each device has its own file, axes and units. There is no gyroscope, no roll, no thrust and no truth, and the
coefficients in the vehicle file have errors.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np
import yaml

from auvid_cli.angles import wrap
from auvid_cli.arrays import Array
from auvid_cli.config.vehicle import VehicleSettings
from auvid_cli.data.checks import csv_text
from auvid_cli.data.dataset import Dataset
from auvid_cli.simulation.imperfections import stream
from auvid_cli.vehicle.coefficients import SYMBOLS

_START = 1.75e9  # s since 1970
_KNOT = 1852.0 / 3600.0  # m/s
_LOCK_PERIOD = 53.0  # s, from one loss of bottom lock to the next
_LOCK_LOSS = 4.0  # s, duration of a loss
_COEFFICIENT_ERROR = 0.3  # share of each coefficient and of the propeller's force


def field_log(dataset: Dataset) -> dict[str, str]:
    """Return the texts of the logs and of a vehicle file by the names of the files.

    Attitude, DVL and depth are logged; coefficients of the vehicle are randomly 30 % too large or too small.
    """
    fins, sensors = dataset.inputs, dataset.sensors
    rudder, elevator = np.rad2deg(fins.values[:, :2].T)
    logged = {
        # In this log, positive angles turn to starboard and pitch the nose down.
        "fins": _log(
            {"top": "deg", "bottom": "deg", "port": "deg", "starboard": "deg", "autonomous": "bool"},
            fins.time,
            [*np.round([-rudder, -rudder, elevator, elevator], 2), np.full(fins.time.size, True)],
        )
    }
    if "attitude" in sensors:
        time, values = sensors["attitude"].time, sensors["attitude"].values
        pitch, heading = np.rad2deg([values[:, 1], wrap(0.5 * np.pi - values[:, 2])])
        logged["compass"] = _log({"pitch": "deg", "Yaw_ENU": "deg"}, time, np.round([pitch, heading], 2))
    if "dvl" in sensors:
        time, values = sensors["dvl"].time, sensors["dvl"].values
        locked = time % _LOCK_PERIOD < _LOCK_PERIOD - _LOCK_LOSS
        velocity = np.where(locked[:, None], values * [1.0, -1.0, -1.0] / _KNOT, 0.0)
        names = {"velocity_x": "knot", "velocity_y": "knot", "velocity_z": "knot", "bottom_lock": "bool"}
        logged["dvl"] = _log(names, time, [*np.round(velocity.T, 3), locked])
    if "depth" in sensors:
        time, values = sensors["depth"].time, sensors["depth"].values
        logged["depth"] = _log({"depth": "m"}, time, np.round(values.T, 2))
    texts = {f"{name}.csv": text for name, text in logged.items()}
    return texts | {"vehicle.yaml": _wrong_vehicle(dataset.experiment.vehicle, dataset.experiment.seed)}


def _log(units: dict[str, str], time: Array, columns: Any) -> str:
    """Return a CSV text: names, units, and a row for each time."""
    stamps = np.round(_START + time, 3)
    rows = ([stamp, *row] for stamp, *row in zip(stamps, *columns, strict=True))
    return csv_text(["time", *units], [["s", *units.values()], *rows])


def _wrong_vehicle(vehicle: VehicleSettings, seed: int) -> str:
    wrong = dict(_with_errors(vehicle.stated_coefficients(), seed))
    parameters = vehicle.known_parameters()
    parameters |= dict(_with_errors({"X_prop": parameters["X_prop"]}, seed))
    content = {
        "name": vehicle.name,
        "source": f"a rough calculation: coefficients and X_prop are {_COEFFICIENT_ERROR:.0%} off; all numbers are SI",
        "size": vehicle.size.model_dump(mode="json"),
        "parameters": parameters,
        "coefficients": {symbol: value for symbol, value in wrong.items() if symbol in SYMBOLS},
    }
    if vehicle.terms:
        entries = (term.model_dump(mode="json", exclude_none=True, exclude_defaults=True) for term in vehicle.terms)
        content["terms"] = [entry | {"value": wrong.get(entry["name"])} for entry in entries]
    return yaml.safe_dump(content, sort_keys=False)


def _with_errors(values: dict[str, float], seed: int) -> Iterator[tuple[str, float]]:
    for symbol, value in values.items():
        sign = stream(seed, "believed", symbol).choice([-1.0, 1.0])
        yield symbol, float(value * (1.0 + sign * _COEFFICIENT_ERROR))
