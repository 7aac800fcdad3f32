"""Settings of the states that are estimated next to coefficients and motion, and of the noise that drives the motion.

Extra states are constant or slowly drifting errors of sensors, actuators and vehicle, time delays, and a disturbance
(Gauss-Markov force and moment). The current is an error of the DVL, because a DVL measures the velocity over ground.
"""

from collections.abc import Collection
from enum import StrEnum
from math import inf, sqrt
from typing import Annotated, ClassVar, Literal, NamedTuple, get_args

from pydantic import Field

from auvid_cli.config.settings import Positive, Settings, three
from auvid_cli.config.units import Amount, AmountPerAxis
from auvid_cli.vehicle.parameters import DEPTH, DISTURBANCE, SENSORS, Quantity

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
    Quantity("rudder_trim", "rad", "actual minus recorded rudder angle", "tau_control"),
    Quantity("elevator_trim", "rad", "actual minus recorded elevator angle", "tau_control"),
)
EXCESS_BUOYANCY = Quantity("excess_buoyancy", "N", "buoyancy less weight, beyond the stated", "g(eta), eq. (13)")
TRIM_MOMENT = Quantity("trim_moment", "N*m", "moment of a level vehicle, bow up, beyond the stated", "g(eta), eq. (13)")
THRUST_SCALE = Quantity("thrust_scale", "1", "scale error of the stated surge force", "tau_propulsion")
DelayedName = Literal[
    "inputs", "dvl", "gyroscope", "attitude", "accelerometer", "magnetometer", "magnetic_field", "depth"
]
# Delay of the inputs: time from command to effect. Delay of a sensor: time stamp minus time of measurement.
DELAYS: dict[str, Quantity] = {
    name: Quantity(f"delay_{name}", "s", f"delay of the {name.replace('_', ' ')} beyond the stated", "measurement")
    for name in get_args(DelayedName)
}

_NotNegative = tuple[Annotated[float, Field(ge=0)], ...]
_Deviation = Field(description="standard deviation of each axis; 0: no disturbance")
_Correlation = Field(description="correlation time of each axis: the autocorrelation falls to 1/e in this time")


class DisturbingForce(Settings):
    """Gauss-Markov force, forward, starboard and down: one number for all three axes or a list of one each."""

    standard_deviation: Annotated[_NotNegative, AmountPerAxis("N"), _Deviation] = (0.0,)
    time_constant: Annotated[Positive, AmountPerAxis("s"), _Correlation] = (5.0,)


class DisturbingMoment(Settings):
    """Gauss-Markov moment about the same axes."""

    standard_deviation: Annotated[_NotNegative, AmountPerAxis("N*m"), _Deviation] = (0.0,)
    time_constant: Annotated[Positive, AmountPerAxis("s"), _Correlation] = (5.0,)


class Disturbance(Settings):
    """Random force and moment that the model lacks, drawn per seed and constant between inputs."""

    force: DisturbingForce = DisturbingForce()
    moment: DisturbingMoment = DisturbingMoment()

    def per_axis(self) -> tuple[tuple[float, float], ...]:
        """Return standard deviation and time constant of X, Y, Z, K, M and N, SI."""
        return tuple(
            pair
            for group in (self.force, self.moment)
            for pair in zip(three(group.standard_deviation), three(group.time_constant), strict=True)
        )


class ProcessNoise(Settings):
    """White process noise of the motion, as amplitude spectral densities: one for three states or one each."""

    velocity: Annotated[Positive, AmountPerAxis("m/s^2/Hz^0.5"), Field(description="density of u, v, w")] = (1e-4,)
    rate: Annotated[Positive, AmountPerAxis("rad/s^2/Hz^0.5"), Field(description="density of p, q, r")] = (1e-4,)
    attitude: Annotated[Positive, AmountPerAxis("rad/s/Hz^0.5"), Field(description="density of phi, theta, psi")] = (
        1e-5,
    )
    depth: Annotated[
        float, Amount("m/s/Hz^0.5"), Field(gt=0, description="density of the depth; used if the depth is measured")
    ] = 1e-3

    def of_motion(self) -> tuple[float, ...]:
        """Return the densities of the nine motion states, SI."""
        return (*three(self.velocity), *three(self.rate), *three(self.attitude))

    def times(
        self, factor: float, names: Collection[str] = ("velocity", "rate", "attitude", "depth")
    ) -> "ProcessNoise":
        """Return the noise with the densities of these names multiplied by `factor`."""

        def multiplied(density: float | tuple[float, ...]) -> float | tuple[float, ...]:
            return tuple(factor * each for each in density) if isinstance(density, tuple) else factor * density

        return self.model_copy(update={name: multiplied(getattr(self, name)) for name in names})


class InitialMotion(Settings):
    """Standard deviations of the initial motion, whose mean is the first sample of each sensor."""

    velocity: Annotated[float, Amount("m/s"), Field(gt=0)] = 0.1
    rate: Annotated[float, Amount("rad/s"), Field(gt=0)] = 0.05
    attitude: Annotated[float, Amount("rad"), Field(gt=0)] = 0.05
    depth: Annotated[float, Amount("m"), Field(gt=0)] = 0.5


class FurtherState(NamedTuple):
    """Kinematic state in addition to the nine motion states, used if `sensor`, which measures only it, is used.

    `name` is its key in `ProcessNoise` and `InitialMotion`.
    """

    name: str
    quantity: Quantity
    sensor: str


# Compiled code of `auvid_cli.identification.process` integrates each of them.
FURTHER_STATES = (FurtherState("depth", DEPTH, "depth"),)


class BiasName(StrEnum):
    """Names of the errors that can be estimated, as `identification.estimate.biases` lists them."""

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
    """States of one error."""

    name: str
    quantities: tuple[Quantity, ...]
    # Sensor with this error; None for errors of actuators and vehicle, which act on the process
    sensor: str | None = None
    prior_std: float = 0.0  # prior standard deviation of each state, SI
    walk: float = 0.0  # random walk, SI per square root of a second; 0 for a constant
    # Whether the error adds, component by component, to states that the sensor measures directly. Otherwise compiled
    # code of `auvid_cli.identification` names each of its symbols.
    additive: bool = False
    # Correlation time of a Gauss-Markov process, s; infinite for a constant or a random walk
    time_constant: float = inf
    # Whether it is a delay: not a state of a filter, but estimated by `auvid_cli.identification.delays`
    is_delay: bool = False
    prefix: str = ""  # start of the keys of its spread and walk in the settings

    @property
    def is_named(self) -> bool:
        """Whether compiled code names each of its symbols."""
        return not self.additive and not self.is_delay and self.time_constant == inf


def _components(sensor: str, prefix: str, words: str, unit: str | None = None) -> tuple[Quantity, ...]:
    """Return one error for each component of a sensor."""
    return tuple(
        Quantity(f"{prefix}_{q.symbol}", unit or q.unit, f"{words} of the measured {q.meaning}", "measurement")
        for q in SENSORS[sensor]
    )


def _bias(sensor: str, additive: bool = True) -> ErrorBlock:
    """Return a bias of each component of a sensor."""
    return ErrorBlock(f"{sensor}_bias", _components(sensor, "bias", "bias"), sensor, additive=additive)


def _one_each(quantities: tuple[Quantity, ...], sensor: str | None = None) -> tuple[ErrorBlock, ...]:
    """Return a block of one state for each quantity."""
    return tuple(ErrorBlock(quantity.symbol, (quantity,), sensor) for quantity in quantities)


_SPREAD = Field(gt=0, description="prior standard deviation")
_WALK = Field(ge=0, description="random walk: growth per square root of a second; 0: constant")
_Share = Annotated[float, Field(ge=1e-9, le=1e3, description="prior standard deviation")]
_ShareWalk = Annotated[float, Amount("1/s^0.5"), _WALK]
_Angle = Annotated[float, Amount("rad"), _SPREAD]
_AngleWalk = Annotated[float, Amount("rad/s^0.5"), _WALK]
_Rate = Annotated[float, Amount("rad/s"), _SPREAD]
_RateWalk = Annotated[float, Amount("rad/s/s^0.5"), _WALK]
_Speed = Annotated[float, Amount("m/s"), _SPREAD]
_SpeedWalk = Annotated[float, Amount("m/s/s^0.5"), _WALK]
_Acceleration = Annotated[float, Amount("m/s^2"), _SPREAD]
_AccelerationWalk = Annotated[float, Amount("m/s^2/s^0.5"), _WALK]
_Field = Annotated[float, Amount("T"), _SPREAD]
_FieldWalk = Annotated[float, Amount("T/s^0.5"), _WALK]
_Length = Annotated[float, Amount("m"), _SPREAD]
_LengthWalk = Annotated[float, Amount("m/s^0.5"), _WALK]
_Force = Annotated[float, Amount("N"), _SPREAD]
_ForceWalk = Annotated[float, Amount("N/s^0.5"), _WALK]
_Moment = Annotated[float, Amount("N*m"), _SPREAD]
_MomentWalk = Annotated[float, Amount("N*m/s^0.5"), _WALK]


class ErrorSettings(Settings):
    """Prior standard deviation and random walk of an error, whose states are in `table`."""

    table: ClassVar[tuple[ErrorBlock, ...]]

    def blocks(self) -> tuple[ErrorBlock, ...]:
        """Return the blocks of states with the spread and walk of these settings."""
        return tuple(
            block._replace(prior_std=getattr(self, f"{block.prefix}spread"), walk=getattr(self, f"{block.prefix}walk"))
            for block in self.table
        )


class GyroErrors(ErrorSettings):
    """Bias of the gyroscope, three components."""

    table = (_bias("gyroscope"),)
    spread: _Rate = 0.01
    walk: _RateWalk = 0.0


class AttitudeErrors(ErrorSettings):
    """Offsets of roll, pitch and heading."""

    table = (_bias("attitude"),)
    spread: _Angle = 0.05
    walk: _AngleWalk = 0.0


class AccelerometerErrors(ErrorSettings):
    """Bias of the accelerometer, three components."""

    table = (_bias("accelerometer", additive=False),)
    spread: _Acceleration = 0.05
    walk: _AccelerationWalk = 0.0


class AccelerometerScaleErrors(ErrorSettings):
    """Scale errors of the accelerometer, three axes."""

    table = (
        ErrorBlock(
            "accelerometer_scale", _components("accelerometer", "scale", "scale error", unit="1"), "accelerometer"
        ),
    )
    spread: _Share = 0.01
    walk: _ShareWalk = 0.0


class MagnetometerErrors(ErrorSettings):
    """Offset of the compass."""

    table = (_bias("magnetometer"),)
    spread: _Angle = 0.05
    walk: _AngleWalk = 0.0


class MagneticFieldErrors(ErrorSettings):
    """Magnetic field of the vehicle in its own axes (hard iron)."""

    table = (_bias("magnetic_field", additive=False),)
    spread: _Field = 5e-6
    walk: _FieldWalk = 0.0


class DvlErrors(ErrorSettings):
    """Scale error and mounting yaw of the DVL."""

    table = (
        ErrorBlock("dvl_scale", (DVL_SCALE,), "dvl", prefix="scale_"),
        ErrorBlock("dvl_yaw", (DVL_YAW,), "dvl", prefix="yaw_"),
    )
    scale_spread: _Share = 0.05
    scale_walk: _ShareWalk = 0.0
    yaw_spread: _Angle = 0.05
    yaw_walk: _AngleWalk = 0.0


class DvlArmErrors(ErrorSettings):
    """Position of the DVL relative to the vehicle's origin (lever arm)."""

    table = _one_each(DVL_ARM, "dvl")
    axes: Annotated[
        tuple[Literal["x", "y", "z"], ...],
        Field(min_length=1, description="components to estimate: forward, starboard, down"),
    ] = ("x",)
    spread: _Length = 0.3
    walk: _LengthWalk = 0.0

    def blocks(self) -> tuple[ErrorBlock, ...]:
        """Return the blocks of the chosen axes."""
        return tuple(block for axis, block in zip("xyz", super().blocks(), strict=True) if axis in self.axes)


class CurrentErrors(ErrorSettings):
    """Horizontal current, north and east, in the velocity over ground that a DVL measures."""

    table = (ErrorBlock("current", CURRENT, "dvl"),)
    spread: _Speed = 0.3
    walk: _SpeedWalk = 1e-3


class ThrustErrors(ErrorSettings):
    """Scale error of the stated surge force, for example of a propeller with a guessed gain."""

    table = (ErrorBlock("thrust", (THRUST_SCALE,)),)
    spread: _Share = 0.3
    walk: _ShareWalk = 0.0


class FinTrimErrors(ErrorSettings):
    """Constant offset between actual and recorded fin angle."""

    table = _one_each(FIN_TRIMS)
    fins: Annotated[
        tuple[Literal["rudder", "elevator"], ...], Field(min_length=1, description="fins with a trim to estimate")
    ] = ("rudder", "elevator")
    spread: _Angle = 0.05
    walk: _AngleWalk = 0.0

    def blocks(self) -> tuple[ErrorBlock, ...]:
        """Return the blocks of the chosen fins."""
        rudder, elevator = super().blocks()
        return tuple(block for fin, block in (("rudder", rudder), ("elevator", elevator)) if fin in self.fins)


class BallastErrors(ErrorSettings):
    """Errors of weight, buoyancy and their centres: a vertical force and a pitching moment."""

    table = (
        ErrorBlock("excess_buoyancy", (EXCESS_BUOYANCY,), prefix="buoyancy_"),
        ErrorBlock("trim_moment", (TRIM_MOMENT,), prefix="moment_"),
    )
    buoyancy_spread: _Force = 10.0
    buoyancy_walk: _ForceWalk = 0.0
    moment_spread: _Moment = 5.0
    moment_walk: _MomentWalk = 0.0


class DelayError(Settings):
    """Constant time delays of inputs (command to effect) and of sensors (time stamp minus time of measurement)."""

    of: Annotated[
        tuple[DelayedName, ...],
        Field(min_length=1, description="delays to estimate, on top of those that `identification.delays` states"),
    ] = ("inputs",)
    spread: Annotated[float, Amount("s"), Field(gt=0, le=10, description="prior standard deviation")] = 0.1

    def blocks(self) -> tuple[ErrorBlock, ...]:
        """Return one block for each delay."""
        return tuple(
            ErrorBlock(delay.symbol, (delay,), prior_std=self.spread, is_delay=True)
            for name, delay in DELAYS.items()
            if name in self.of
        )


class EstimatedDisturbance(Disturbance):
    """Gauss-Markov force and moment that the model lacks, one state for each axis with a standard deviation."""

    def blocks(self) -> tuple[ErrorBlock, ...]:
        """Return the blocks of the axes; `walk` is the noise that keeps the variance of each stationary."""
        return tuple(
            ErrorBlock(quantity.symbol, (quantity,), None, size, size * sqrt(2.0 / time), time_constant=time)
            for quantity, (size, time) in zip(DISTURBANCE, self.per_axis(), strict=True)
            if size > 0.0
        )


class AugmentedStates(Settings):
    """Errors to estimate next to coefficients and motion."""

    biases: Annotated[
        tuple[BiasName, ...],
        Field(description="errors to estimate, any of " + ", ".join(f"`{name}`" for name in BiasName)),
    ] = ()
    gyro: GyroErrors = GyroErrors()
    attitude: AttitudeErrors = AttitudeErrors()
    accelerometer: AccelerometerErrors = AccelerometerErrors()
    accelerometer_scale: AccelerometerScaleErrors = AccelerometerScaleErrors()
    magnetometer: MagnetometerErrors = MagnetometerErrors()
    magnetic_field: MagneticFieldErrors = MagneticFieldErrors()
    dvl: DvlErrors = DvlErrors()
    dvl_arm: DvlArmErrors = DvlArmErrors()
    current: CurrentErrors = CurrentErrors()
    thrust: ThrustErrors = ThrustErrors()
    fin_trim: FinTrimErrors = FinTrimErrors()
    ballast: BallastErrors = BallastErrors()
    delay: DelayError = DelayError()
    disturbance: EstimatedDisturbance = EstimatedDisturbance()

    def blocks_of(self, name: BiasName) -> tuple[ErrorBlock, ...]:
        """Return the blocks of one error, whether it is to be estimated or not."""
        return getattr(self, name.value).blocks()

    def blocks(self) -> tuple[ErrorBlock, ...]:
        """Return the blocks to estimate, each once."""
        return tuple(block for name in dict.fromkeys(self.biases) for block in self.blocks_of(name))


_EVERYTHING = AugmentedStates(
    biases=tuple(BiasName),
    dvl_arm=DvlArmErrors(axes=("x", "y", "z")),
    delay=DelayError(of=get_args(DelayedName)),
    disturbance=EstimatedDisturbance(
        force=DisturbingForce(standard_deviation=(1.0,)), moment=DisturbingMoment(standard_deviation=(1.0,))
    ),
)
# Every block that settings can select, with the default of its spread.
ERROR_BLOCKS = _EVERYTHING.blocks()
ERROR_STATES = tuple(quantity for block in ERROR_BLOCKS for quantity in block.quantities)
