"""A simulated run in the form of logs from the field with their map, for practice.

Each device has its own file, axes and units. There is no gyroscope, no roll, no thrust and no truth, and the
coefficients in the vehicle file have errors.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np
import yaml

from auvid_cli.arrays import Array, wrap
from auvid_cli.config.vehicle import VehicleSettings
from auvid_cli.data.checks import csv_text
from auvid_cli.data.dataset import Dataset
from auvid_cli.simulation.simulate import stream
from auvid_cli.vehicle.coefficients import SYMBOLS

_START = 1.75e9  # s since 1970
_KNOT = 1852.0 / 3600.0  # m/s
_LOCK_PERIOD = 53.0  # s, from one loss of bottom lock to the next
_LOCK_LOSS = 4.0  # s, duration of a loss
_COEFFICIENT_ERROR = 0.3  # share of each coefficient and of the propeller's force

_MAP_HEAD = (
    "# Columns of each signal. The thrust was not logged: it is constant, 10 N is a guess, so its scale is estimated.\n"
    "# The vehicle file is a rough calculation, so the prior is half as wide as its values. A current is constant.\n"
)
_IDENTIFICATION = {
    "prior": {"mean": "vehicle", "relative": "50 %"},
    "tolerances": "usual",
    "estimate": {"biases": ["thrust"], "thrust": {"spread": 0.3}, "current": {"walk": "0 m/s/s^0.5"}},
}
_FINS = {
    "top": {"column": "top", "sign": -1, "unit": "deg"},
    "bottom": {"column": "bottom", "sign": -1, "unit": "deg"},
    "right": {"column": "starboard", "unit": "deg"},
    "left": {"column": "port", "unit": "deg"},
}
# Log of each sensor and its entry in the map. Standard deviations are those of a data sheet, not of the simulation.
_SENSORS: dict[str, tuple[str, dict[str, Any]]] = {
    "dvl": (
        "dvl",
        {
            "columns": {"u": "velocity_x", "v": "velocity_y", "w": "velocity_z"},
            "unit": "knot",
            "frame": "FLU",
            "valid": {"column": "bottom_lock", "values": [True]},
            "standard_deviation": "1 cm/s",
        },
    ),
    "attitude": (
        "compass",
        {
            "columns": {"theta": "pitch", "psi": {"column": "Yaw_ENU", "sign": -1, "offset": "90 deg"}},
            "unit": "deg",
            "standard_deviation": "0.2 deg",
        },
    ),
    "depth": ("depth", {"columns": {"down": "depth"}, "unit": "m", "standard_deviation": "1 cm"}),
}


def field_log(dataset: Dataset) -> dict[str, str]:
    """Return the texts of the logs, of a vehicle file, and of the map by the names of the files.

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
    vehicle = _wrong_vehicle(dataset.experiment.vehicle, dataset.experiment.seed)
    return texts | {"vehicle.yaml": vehicle, "map.yaml": _map(dataset)}


def _map(dataset: Dataset) -> str:
    """Return the map of the logs, with what a user knows: data sheets of the sensors, and no thrust."""
    content: dict[str, Any] = {
        "name": "survey",
        "vehicle": "vehicle.yaml",
        "logs": {"fins": "fins.csv"},
        "sensors": {},
        "inputs": {"log": "fins", "time": "time", "fins": _FINS, "surge_force": {"constant": "10 N"}},
        "identification": _IDENTIFICATION,
    }
    for name, (log, entry) in _SENSORS.items():
        if name in dataset.sensors:
            content["logs"][log] = f"{log}.csv"
            content["sensors"][name] = {"log": log, "time": "time", **entry}
    return f"{_MAP_HEAD}{yaml.safe_dump(content, sort_keys=False)}"


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
