"""Errors of sensors and actuators that may be estimated along with the coefficients, and what is known beforehand.

A block of them is written down here alone: its settings, its states, and whose errors they are. A current is one of
them: an error of the DVL that would measure the motion through the water. So are the scale error of the thrust, the
ballast and what disturbs the motion, which no sensor measures.
"""

from enum import StrEnum
from math import inf, sqrt
from typing import Annotated, ClassVar, Literal, NamedTuple, get_args

from pydantic import Field

from auvid_cli.config.disturbance import Disturbance, DisturbingForce, DisturbingMoment
from auvid_cli.config.quantity import Amount
from auvid_cli.config.settings import Settings
from auvid_cli.vehicle.parameters import DISTURBANCE, SENSORS, Quantity

DVL_SCALE = Quantity("dvl_scale", "1", "scale error of the DVL", "measurement")
DVL_YAW = Quantity("dvl_yaw", "rad", "mounting yaw of the DVL", "measurement")
CURRENT = (
    Quantity("current_north", "m/s", "current, north", "measurement"),
    Quantity("current_east", "m/s", "current, east", "measurement"),
)
DVL_ARM = (
    Quantity("dvl_x", "m", "DVL ahead of the origin", "measurement"),
    Quantity("dvl_y", "m", "DVL to starboard of the origin", "measurement"),
    Quantity("dvl_z", "m", "DVL below the origin", "measurement"),
)
FIN_TRIMS = (
    Quantity("rudder_trim", "rad", "rudder beyond its stated deflection", "tau_control"),
    Quantity("elevator_trim", "rad", "elevator beyond its stated deflection", "tau_control"),
)
EXCESS_BUOYANCY = Quantity("excess_buoyancy", "N", "buoyancy less weight, beyond the stated", "g(eta), eq. (13)")
# Of inputs how much later than stated they act, of a sensor how much later than they were taken samples are stamped.
DelayedName = Literal[
    "inputs", "dvl", "gyroscope", "attitude", "accelerometer", "magnetometer", "magnetic_field", "depth"
]
DELAYS: dict[str, Quantity] = {
    name: Quantity(f"delay_{name}", "s", f"delay of the {name.replace('_', ' ')} beyond the stated", "measurement")
    for name in get_args(DelayedName)
}
TRIM_MOMENT = Quantity("trim_moment", "N*m", "moment of a level vehicle, bow up, beyond the stated", "g(eta), eq. (13)")
THRUST_SCALE = Quantity("thrust_scale", "1", "scale error of the stated surge force", "tau_propulsion")


class BiasName(StrEnum):
    """What may be asked for, by the key of its settings."""

    GYRO = "gyro"
    ATTITUDE = "attitude"
    ACCELEROMETER = "accelerometer"
    ACCELEROMETER_SCALE = "accelerometer_scale"
    MAGNETOMETER = "magnetometer"
    MAGNETIC_FIELD = "magnetic_field"
    DVL = "dvl"
    DVL_ARM = "dvl_arm"
    CURRENT = "current"
    THRUST = "thrust"
    FIN_TRIM = "fin_trim"
    BALLAST = "ballast"
    DELAY = "delay"
    DISTURBANCE = "disturbance"


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
        Whose error it is; None for one of the actuators or of the vehicle, which the process knows.
    additive : bool
        Whether component by component it adds to states that the sensor measures as they are; otherwise compiled code
        of `auvid_cli.identification` names each of its symbols.
    time_constant : float
        After which 1/e of it is left, s; infinite for what does not fade.
    shifts : bool
        Whether it moves times, and not what is measured or acts: no state of a filter, but found beside it, see
        `auvid_cli.identification.delays`.
    """

    name: str
    quantities: tuple[Quantity, ...]
    prior_std: float
    walk: float
    sensor: str | None
    additive: bool = False
    time_constant: float = inf
    shifts: bool = False

    @property
    def is_named(self) -> bool:
        """Say whether compiled code names each of its symbols: not those of axes that are all alike."""
        return not self.additive and not self.shifts and self.time_constant == inf


class _Bias(Settings):
    """One bias of each component of a sensor, which adds to what it measures."""

    sensor: ClassVar[str]
    prefix: ClassVar[str] = "bias"
    is_linear: ClassVar[bool] = True
    spread: float
    walk: float

    def blocks(self) -> tuple[ErrorBlock, ...]:
        """Return the states, a bias for each component."""
        biases = tuple(
            Quantity(
                f"{self.prefix}_{measured.symbol}",
                measured.unit,
                f"bias of the measured {measured.meaning}",
                "measurement",
            )
            for measured in SENSORS[self.sensor]
        )
        return (ErrorBlock(f"{self.sensor}_bias", biases, self.spread, self.walk, self.sensor, self.is_linear),)


class GyroBias(_Bias):
    """Bias of the gyroscope, three components."""

    sensor = "gyroscope"

    spread: Annotated[float, Amount("rad/s"), Field(gt=0, description="standard deviation before any data")] = 0.01
    walk: Annotated[
        float, Amount("rad/s/s^0.5"), Field(ge=0, description="growth per square root of a second; 0: constant")
    ] = 0.0


class AttitudeBias(_Bias):
    """Offsets of roll, pitch and heading."""

    sensor = "attitude"

    spread: Annotated[float, Amount("rad"), Field(gt=0, description="standard deviation before any data")] = 0.05
    walk: Annotated[
        float, Amount("rad/s^0.5"), Field(ge=0, description="growth per square root of a second; 0: constant")
    ] = 0.0


class AccelerometerBias(_Bias):
    """Bias of the accelerometer, three components."""

    sensor = "accelerometer"
    is_linear = False

    spread: Annotated[float, Amount("m/s^2"), Field(gt=0, description="standard deviation before any data")] = 0.05
    walk: Annotated[
        float, Amount("m/s^2/s^0.5"), Field(ge=0, description="growth per square root of a second; 0: constant")
    ] = 0.0


class AccelerometerScale(Settings):
    """Scale errors of the accelerometer, three axes."""

    spread: Annotated[float, Field(ge=1e-9, le=1e3, description="standard deviation before any data")] = 0.01
    walk: Annotated[float, Amount("1/s^0.5"), Field(ge=0, description="growth; 0: constant")] = 0.0

    def blocks(self) -> tuple[ErrorBlock, ...]:
        """Return the states, a scale error for each axis."""
        scales = tuple(
            Quantity(f"scale_{measured.symbol}", "1", f"scale error of the measured {measured.meaning}", "measurement")
            for measured in SENSORS["accelerometer"]
        )
        return (ErrorBlock("accelerometer_scale", scales, self.spread, self.walk, "accelerometer"),)


class MagnetometerBias(_Bias):
    """Offset of the compass."""

    sensor = "magnetometer"

    spread: Annotated[float, Amount("rad"), Field(gt=0, description="standard deviation before any data")] = 0.05
    walk: Annotated[
        float, Amount("rad/s^0.5"), Field(ge=0, description="growth per square root of a second; 0: constant")
    ] = 0.0


class HardIron(_Bias):
    """Field of the vehicle itself, in its own axes: what is magnetic in it turns with it."""

    sensor = "magnetic_field"
    is_linear = False

    spread: Annotated[float, Amount("T"), Field(gt=0, description="standard deviation before any data")] = 5e-6
    walk: Annotated[
        float, Amount("T/s^0.5"), Field(ge=0, description="growth per square root of a second; 0: constant")
    ] = 0.0


class DvlError(Settings):
    """Scale error and mounting yaw of the DVL."""

    scale_spread: Annotated[float, Field(ge=1e-9, le=1e3, description="standard deviation before any data")] = 0.05
    scale_walk: Annotated[float, Amount("1/s^0.5"), Field(ge=0, description="growth; 0: constant")] = 0.0
    yaw_spread: Annotated[float, Amount("rad"), Field(gt=0, description="standard deviation before any data")] = 0.05
    yaw_walk: Annotated[float, Amount("rad/s^0.5"), Field(ge=0, description="growth; 0: constant")] = 0.0

    def blocks(self) -> tuple[ErrorBlock, ...]:
        """Return the states, which may be constant or walk one without the other."""
        return (
            ErrorBlock("dvl_scale", (DVL_SCALE,), self.scale_spread, self.scale_walk, "dvl"),
            ErrorBlock("dvl_yaw", (DVL_YAW,), self.yaw_spread, self.yaw_walk, "dvl"),
        )


class DvlArm(Settings):
    """Where the DVL sits, from the vehicle's origin: a vehicle that turns carries it along."""

    axes: Annotated[
        tuple[Literal["x", "y", "z"], ...],
        Field(min_length=1, description="components that are sought: forward, starboard, down"),
    ] = ("x",)
    spread: Annotated[float, Amount("m"), Field(gt=0, description="standard deviation before any data")] = 0.3
    walk: Annotated[float, Amount("m/s^0.5"), Field(ge=0, description="growth; 0: constant")] = 0.0

    def blocks(self) -> tuple[ErrorBlock, ...]:
        """Return the states, one for each component."""
        return tuple(
            ErrorBlock(arm.symbol, (arm,), self.spread, self.walk, "dvl")
            for axis, arm in zip("xyz", DVL_ARM, strict=True)
            if axis in self.axes
        )


class Current(Settings):
    """Horizontal current, north and east: what a DVL measures over ground beyond the motion through the water."""

    spread: Annotated[float, Amount("m/s"), Field(gt=0, description="standard deviation before any data")] = 0.3
    walk: Annotated[
        float, Amount("m/s/s^0.5"), Field(ge=0, description="growth per square root of a second; 0: constant")
    ] = 1e-3

    def blocks(self) -> tuple[ErrorBlock, ...]:
        """Return the states, north and east."""
        return (ErrorBlock("current", CURRENT, self.spread, self.walk, "dvl"),)


class ThrustScale(Settings):
    """Scale error of the stated surge force: that of a propeller whose gain is a guess."""

    spread: Annotated[float, Field(ge=1e-9, le=1e3, description="standard deviation before any data")] = 0.3
    walk: Annotated[float, Amount("1/s^0.5"), Field(ge=0, description="growth; 0: constant")] = 0.0

    def blocks(self) -> tuple[ErrorBlock, ...]:
        """Return the one state."""
        return (ErrorBlock("thrust", (THRUST_SCALE,), self.spread, self.walk, None),)


class FinTrims(Settings):
    """Angles that the fins stand beyond what is stated: a zero that is off, or a hull that is bent."""

    fins: Annotated[
        tuple[Literal["rudder", "elevator"], ...], Field(min_length=1, description="whose trims are sought")
    ] = ("rudder", "elevator")
    spread: Annotated[float, Amount("rad"), Field(gt=0, description="standard deviation before any data")] = 0.05
    walk: Annotated[float, Amount("rad/s^0.5"), Field(ge=0, description="growth; 0: constant")] = 0.0

    def blocks(self) -> tuple[ErrorBlock, ...]:
        """Return the states."""
        return tuple(
            ErrorBlock(trim.symbol, (trim,), self.spread, self.walk, None)
            for trim in FIN_TRIMS
            if trim.symbol.removesuffix("_trim") in self.fins
        )


class BallastError(Settings):
    """Weight and buoyancy that are not as stated, or act elsewhere: a vertical force and a moment in pitch."""

    buoyancy_spread: Annotated[float, Amount("N"), Field(gt=0, description="standard deviation before any data")] = 10.0
    buoyancy_walk: Annotated[float, Amount("N/s^0.5"), Field(ge=0, description="growth; 0: constant")] = 0.0
    moment_spread: Annotated[float, Amount("N*m"), Field(gt=0, description="standard deviation before any data")] = 5.0
    moment_walk: Annotated[float, Amount("N*m/s^0.5"), Field(ge=0, description="growth; 0: constant")] = 0.0

    def blocks(self) -> tuple[ErrorBlock, ...]:
        """Return the states, which may be constant or walk one without the other."""
        return (
            ErrorBlock("excess_buoyancy", (EXCESS_BUOYANCY,), self.buoyancy_spread, self.buoyancy_walk, None),
            ErrorBlock("trim_moment", (TRIM_MOMENT,), self.moment_spread, self.moment_walk, None),
        )


class DelayError(Settings):
    """How much later than stated inputs act, or than they were taken samples of a sensor are stamped; constant."""

    of: Annotated[
        tuple[DelayedName, ...],
        Field(min_length=1, description="whose delays are sought, beyond those that `identification.delays` states"),
    ] = ("inputs",)
    spread: Annotated[float, Amount("s"), Field(gt=0, le=10, description="standard deviation before any data")] = 0.1

    def blocks(self) -> tuple[ErrorBlock, ...]:
        """Return what stands for them."""
        return tuple(
            ErrorBlock(delay.symbol, (delay,), self.spread, 0.0, None, shifts=True)
            for name, delay in DELAYS.items()
            if name in self.of
        )


class EstimatedDisturbance(Disturbance):
    """Gauss-Markov force and moment beside those of the model, a state for each axis with a standard deviation."""

    def blocks(self) -> tuple[ErrorBlock, ...]:
        """Return the states, each stationary: what it forgets is made up for by the noise that drives it."""
        return tuple(
            ErrorBlock(quantity.symbol, (quantity,), size, size * sqrt(2.0 / time), None, time_constant=time)
            for quantity, (size, time) in zip(DISTURBANCE, self.per_axis(), strict=True)
            if size > 0.0
        )


class AugmentedStates(Settings):
    """What is estimated besides coefficients and motion."""

    biases: Annotated[
        tuple[BiasName, ...],
        Field(description="blocks of further states: " + ", ".join(f"`{name}`" for name in BiasName)),
    ] = ()
    gyro: GyroBias = GyroBias()
    attitude: AttitudeBias = AttitudeBias()
    accelerometer: AccelerometerBias = AccelerometerBias()
    accelerometer_scale: AccelerometerScale = AccelerometerScale()
    magnetometer: MagnetometerBias = MagnetometerBias()
    magnetic_field: HardIron = HardIron()
    dvl: DvlError = DvlError()
    dvl_arm: DvlArm = DvlArm()
    current: Current = Current()
    thrust: ThrustScale = ThrustScale()
    fin_trim: FinTrims = FinTrims()
    ballast: BallastError = BallastError()
    delay: DelayError = DelayError()
    disturbance: EstimatedDisturbance = EstimatedDisturbance()

    def blocks(self) -> tuple[ErrorBlock, ...]:
        """Return the blocks that are asked for, each once."""
        return tuple(block for name in dict.fromkeys(self.biases) for block in getattr(self, name.value).blocks())


if {*AugmentedStates.model_fields} - {"biases"} != {*BiasName}:
    raise TypeError("each block of further states has a name in BiasName and settings in AugmentedStates")

# Every block that may be asked for, whatever the settings say, and its states.
_ON_ALL_AXES = EstimatedDisturbance(
    force=DisturbingForce(standard_deviation=(1.0,)), moment=DisturbingMoment(standard_deviation=(1.0,))
)
ERROR_BLOCKS = AugmentedStates(
    biases=tuple(BiasName),
    delay=DelayError(of=get_args(DelayedName)),
    disturbance=_ON_ALL_AXES,
    dvl_arm=DvlArm(axes=("x", "y", "z")),
).blocks()
ERROR_STATES = tuple(quantity for block in ERROR_BLOCKS for quantity in block.quantities)
if len({quantity.symbol for quantity in ERROR_STATES}) < len(ERROR_STATES):
    raise TypeError("two errors have the same symbol: a second sensor of the same states needs a `prefix` of its own")
