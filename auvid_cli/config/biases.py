"""Which sensor errors, and which current, are estimated along with the coefficients, and what is known beforehand."""

from enum import StrEnum
from typing import Annotated

from pydantic import Field

from auvid_cli.config.model import Settings
from auvid_cli.config.quantity import Amount


class BiasName(StrEnum):
    """A block of the augmented state."""

    GYRO = "gyro"
    ATTITUDE = "attitude"
    DVL = "dvl"
    CURRENT = "current"
    THRUST = "thrust"


class GyroBias(Settings):
    """Bias of the gyroscope, three components."""

    spread: Annotated[float, Amount("rad/s"), Field(gt=0, description="standard deviation before any data")] = 0.01
    walk: Annotated[
        float, Amount("rad/s/s^0.5"), Field(ge=0, description="growth per square root of a second; 0: constant")
    ] = 0.0


class AttitudeBias(Settings):
    """Offsets of roll, pitch and heading."""

    spread: Annotated[float, Amount("rad"), Field(gt=0, description="standard deviation before any data")] = 0.05
    walk: Annotated[
        float, Amount("rad/s^0.5"), Field(ge=0, description="growth per square root of a second; 0: constant")
    ] = 0.0


class DvlError(Settings):
    """Scale error and mounting yaw of the DVL."""

    scale_spread: Annotated[float, Field(ge=1e-9, le=1e3, description="standard deviation before any data")] = 0.05
    scale_walk: Annotated[float, Amount("1/s^0.5"), Field(ge=0, description="growth; 0: constant")] = 0.0
    yaw_spread: Annotated[float, Amount("rad"), Field(gt=0, description="standard deviation before any data")] = 0.05
    yaw_walk: Annotated[float, Amount("rad/s^0.5"), Field(ge=0, description="growth; 0: constant")] = 0.0


class Current(Settings):
    """Horizontal current, north and east: what a DVL sees over ground beyond the motion through the water."""

    spread: Annotated[float, Amount("m/s"), Field(gt=0, description="standard deviation before any data")] = 0.3
    walk: Annotated[
        float, Amount("m/s/s^0.5"), Field(ge=0, description="growth per square root of a second; 0: constant")
    ] = 1e-3


class ThrustScale(Settings):
    """Scale error of the stated surge force: that of a propeller whose gain is a guess."""

    spread: Annotated[float, Field(ge=1e-9, le=1e3, description="standard deviation before any data")] = 0.3
    walk: Annotated[float, Amount("1/s^0.5"), Field(ge=0, description="growth; 0: constant")] = 0.0


class Estimate(Settings):
    """What is estimated besides coefficients and motion."""

    biases: Annotated[
        tuple[BiasName, ...],
        Field(description="blocks of further states: `gyro`, `attitude`, `dvl`, `current`, `thrust`"),
    ] = ()
    gyro: GyroBias = GyroBias()
    attitude: AttitudeBias = AttitudeBias()
    dvl: DvlError = DvlError()
    current: Current = Current()
    thrust: ThrustScale = ThrustScale()
