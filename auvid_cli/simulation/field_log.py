"""A simulated run as a vehicle of somebody else would have logged it, for practice.

Each device has a file, clock, axes and units of its own. There is no gyroscope, no roll and no thrust, and nothing of
the truth; what is believed of the vehicle is wrong by a good part.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray

from auvid_cli.angles import wrap
from auvid_cli.config.vehicle import VehicleSettings
from auvid_cli.data.checks import csv_text
from auvid_cli.data.dataset import Dataset
from auvid_cli.simulation.imperfections import stream
from auvid_cli.vehicle.coefficients import SYMBOLS

Array = NDArray[np.float64]

# s since 1970, when the vehicle was switched on.
_SWITCHED_ON = 1.75e9
_KNOT = 1852.0 / 3600.0
# s: how often, and for how long, the DVL has no bottom lock.
_EVERY, _LOST = 53.0, 4.0
# Of every coefficient, and of the propeller's force.
_WRONG_BY = 0.3


def field_log(dataset: Dataset) -> dict[str, str]:
    """Write the logs of a run, and a vehicle file whose coefficients are 30 % off, too large or too small at random.

    Parameters
    ----------
    dataset : Dataset
        Simulated, with all sensors that are logged: attitude, DVL and depth.

    Returns
    -------
    dict of str
        Text of each file by its name.
    """
    fins, sensors = dataset.inputs, dataset.sensors
    rudder, elevator = np.rad2deg(fins.values[:, :2].T)
    logged = {
        # Positive turns to starboard, and noses down.
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
        locked = time % _EVERY < _EVERY - _LOST
        velocity = np.where(locked[:, None], values * [1.0, -1.0, -1.0] / _KNOT, 0.0)
        names = {"velocity_x": "knot", "velocity_y": "knot", "velocity_z": "knot", "bottom_lock": "bool"}
        logged["dvl"] = _log(names, time, [*np.round(velocity.T, 3), locked])
    if "depth" in sensors:
        time, values = sensors["depth"].time, sensors["depth"].values
        logged["depth"] = _log({"depth": "m"}, time, np.round(values.T, 2))
    texts = {f"{name}.csv": text for name, text in logged.items()}
    return texts | {"vehicle.yaml": _believed(dataset.experiment.vehicle, dataset.experiment.seed)}


def _log(units: dict[str, str], time: Array, columns: Any) -> str:
    """Write names, units under them, and a row for each time."""
    stamps = np.round(_SWITCHED_ON + time, 3)
    rows = ([stamp, *row] for stamp, *row in zip(stamps, *columns, strict=True))
    return csv_text(["time", *units], [["s", *units.values()], *rows])


def _believed(vehicle: VehicleSettings, seed: int) -> str:
    """Write a vehicle file that is off."""
    wrong = dict(_wrong(vehicle.stated_coefficients(), seed))
    parameters = vehicle.known_parameters()
    parameters |= dict(_wrong({"X_prop": parameters["X_prop"]}, seed))
    believed = {
        "name": vehicle.name,
        "source": f"a rough calculation: coefficients and X_prop are {_WRONG_BY:.0%} off; all numbers are SI",
        "size": vehicle.size.model_dump(mode="json"),
        "parameters": parameters,
        "coefficients": {symbol: value for symbol, value in wrong.items() if symbol in SYMBOLS},
    }
    if vehicle.terms:
        entries = (term.model_dump(mode="json", exclude_none=True, exclude_defaults=True) for term in vehicle.terms)
        believed["terms"] = [entry | {"value": wrong.get(entry["name"])} for entry in entries]
    return yaml.safe_dump(believed, sort_keys=False)


def _wrong(values: dict[str, float], seed: int) -> Iterator[tuple[str, float]]:
    for symbol, value in values.items():
        side = stream(seed, "believed", symbol).choice([-1.0, 1.0])
        yield symbol, float(value * (1.0 + side * _WRONG_BY))
