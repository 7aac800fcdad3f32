"""Sensor errors as blocks of the augmented state: constant ones among the parameters, walking ones behind motion.

A current is one of them: an error of the DVL that would measure the motion through the water. So is the scale error of
the thrust, which is nobody's reading.
"""

from collections.abc import Sequence
from typing import NamedTuple

from auvid_cli.config.biases import BiasName, Estimate
from auvid_cli.data.dataset import SENSORS

DVL_ERRORS = "dvl_scale", "dvl_yaw", "current_north", "current_east"

THRUST_SCALE = "thrust_scale"


class SensorError(NamedTuple):
    """One state that stands for an error of a sensor.

    Attributes
    ----------
    symbol, unit : str
    sensor : str
        Whose error it is; or "thrust".
    component : int
        Of the reading that it adds to; -1 for a nonlinear one.
    spread : float
        Standard deviation before any data, SI.
    walk : float
        Growth per square root of a second, SI; 0 for a constant.
    """

    symbol: str
    unit: str
    sensor: str
    component: int
    spread: float
    walk: float


def sensor_errors(estimate: Estimate) -> list[SensorError]:
    """States that the settings ask for, block by block."""
    errors = []
    for block in dict.fromkeys(estimate.biases):
        match block:
            case BiasName.DVL:
                dvl = estimate.dvl
                scale, yaw, *_ = DVL_ERRORS
                errors.append(SensorError(scale, "1", "dvl", -1, dvl.scale_spread, dvl.scale_walk))
                errors.append(SensorError(yaw, "rad", "dvl", -1, dvl.yaw_spread, dvl.yaw_walk))
            case BiasName.CURRENT:
                spread, walk = estimate.current.spread, estimate.current.walk
                errors.extend(SensorError(symbol, "m/s", "dvl", -1, spread, walk) for symbol in DVL_ERRORS[2:])
            case BiasName.THRUST:
                errors.append(
                    SensorError(THRUST_SCALE, "1", "thrust", -1, estimate.thrust.spread, estimate.thrust.walk)
                )
            case BiasName.GYRO:
                errors.extend(_additive("gyroscope", estimate.gyro.spread, estimate.gyro.walk))
            case BiasName.ATTITUDE:
                errors.extend(_additive("attitude", estimate.attitude.spread, estimate.attitude.walk))
    return errors


def _additive(sensor: str, spread: float, walk: float) -> list[SensorError]:
    return [
        SensorError(f"bias_{quantity.symbol}", quantity.unit, sensor, component, spread, walk)
        for component, quantity in enumerate(SENSORS[sensor])
    ]


def constant_errors(errors: Sequence[SensorError]) -> list[SensorError]:
    """Those that stand among the parameters, behind the coefficients."""
    return [error for error in errors if error.walk == 0.0]


def walking_errors(errors: Sequence[SensorError]) -> list[SensorError]:
    """Those that stand behind the motion states."""
    return [error for error in errors if error.walk > 0.0]
