"""Errors of sensors and actuators that are states: one block each, constant or a random walk.

A current is one of them: an error of the DVL that would measure the motion through the water. So is the scale error of
the thrust, which no sensor measures.
"""

from typing import NamedTuple, assert_never

from auvid_cli.config.biases import BiasName, Estimate
from auvid_cli.data.dataset import SENSORS
from auvid_cli.vehicle.parameters import Quantity

DVL_SCALE = Quantity("dvl_scale", "1", "scale error of the DVL", "measurement")
DVL_YAW = Quantity("dvl_yaw", "rad", "mounting yaw of the DVL", "measurement")
CURRENT = (
    Quantity("current_north", "m/s", "current, north", "measurement"),
    Quantity("current_east", "m/s", "current, east", "measurement"),
)
THRUST_SCALE = Quantity("thrust_scale", "1", "scale error of the stated surge force", "tau_propulsion")


class ErrorBlock(NamedTuple):
    """States that stand for an error.

    Attributes
    ----------
    name : str
    quantities : tuple of Quantity
    prior_std : float
        Standard deviation of each before any data, SI.
    walk : float
        Growth per square root of a second, SI; 0 for a constant.
    sensor : str or None
        Whose error it is; None for one of the actuators, which the process knows.
    additive : bool
        Whether component by component it adds to what the sensor measures; otherwise
        `auvid_cli.identification.observation` knows it by its symbols.
    """

    name: str
    quantities: tuple[Quantity, ...]
    prior_std: float
    walk: float
    sensor: str | None
    additive: bool = False


def error_blocks(estimate: Estimate) -> list[ErrorBlock]:
    """The blocks that the settings ask for."""
    blocks = []
    for name in dict.fromkeys(estimate.biases):
        match name:
            case BiasName.DVL:
                dvl = estimate.dvl
                blocks.append(ErrorBlock("dvl_scale", (DVL_SCALE,), dvl.scale_spread, dvl.scale_walk, "dvl"))
                blocks.append(ErrorBlock("dvl_yaw", (DVL_YAW,), dvl.yaw_spread, dvl.yaw_walk, "dvl"))
            case BiasName.CURRENT:
                blocks.append(ErrorBlock("current", CURRENT, estimate.current.spread, estimate.current.walk, "dvl"))
            case BiasName.THRUST:
                thrust = estimate.thrust
                blocks.append(ErrorBlock("thrust", (THRUST_SCALE,), thrust.spread, thrust.walk, None))
            case BiasName.GYRO:
                blocks.append(_additive("gyroscope", estimate.gyro.spread, estimate.gyro.walk))
            case BiasName.ATTITUDE:
                blocks.append(_additive("attitude", estimate.attitude.spread, estimate.attitude.walk))
            case _:
                assert_never(name)
    return blocks


def _additive(sensor: str, prior_std: float, walk: float) -> ErrorBlock:
    quantities = tuple(
        Quantity(f"bias_{q.symbol}", q.unit, f"bias of the measured {q.meaning}", "measurement")
        for q in SENSORS[sensor]
    )
    return ErrorBlock(f"{sensor}_bias", quantities, prior_std, walk, sensor, additive=True)
