"""Settings of the states that are estimated next to coefficients and motion, and of the noise that drives the motion.

Extra states are constant or slowly drifting errors of sensors, actuators and vehicle, time delays, and a disturbance
(Gauss-Markov force and moment). The current is an error of the DVL, because a DVL measures the velocity over ground.
"""

from collections.abc import Collection
from enum import StrEnum
from math import inf, sqrt
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, NamedTuple, get_args

from pydantic import Field

from auvid_cli.config.settings import Positive, Settings, make_settings, three, with_fields
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
EXCESS_BUOYANCY = Quantity(
    "excess_buoyancy", "N", "buoyancy minus weight, beyond the stated difference", "g(eta), eq. (13)"
)
TRIM_MOMENT = Quantity(
    "trim_moment", "N*m", "pitching moment at zero pitch, bow up, beyond the stated moment", "g(eta), eq. (13)"
)
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
    """White process noise of the motion, as amplitude spectral densities: one number for three states, or one each."""

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

    velocity: Annotated[float, Amount("m/s"), Field(gt=0, description="standard deviation of u, v, w")] = 0.1
    rate: Annotated[float, Amount("rad/s"), Field(gt=0, description="standard deviation of p, q, r")] = 0.05
    attitude: Annotated[float, Amount("rad"), Field(gt=0, description="standard deviation of phi, theta, psi")] = 0.05
    depth: Annotated[float, Amount("m"), Field(gt=0, description="standard deviation of the depth")] = 0.5


class FurtherState(NamedTuple):
    """Kinematic state in addition to the nine motion states; used if `sensor` is, which measures no other state.

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


def _bias(sensor: str, spread: float, additive: bool = True) -> ErrorBlock:
    """Return a bias of each component of a sensor."""
    return ErrorBlock(f"{sensor}_bias", _components(sensor, "bias", "bias"), sensor, spread, additive=additive)


_SPREAD = Field(gt=0, description="standard deviation of the error before any data")
_WALK = Field(ge=0, description="random walk: growth per square root of a second; 0: constant")
_Share = Annotated[float, Field(ge=1e-9, le=1e3, description="standard deviation of the error before any data")]


class ErrorSettings(Settings):
    """Prior standard deviation and random walk of an error, whose states are in `table`."""

    table: ClassVar[tuple[ErrorBlock, ...]]

    def blocks(self) -> tuple[ErrorBlock, ...]:
        """Return the blocks of states with the spread and walk of these settings."""
        return tuple(
            block._replace(prior_std=getattr(self, f"{block.prefix}spread"), walk=getattr(self, f"{block.prefix}walk"))
            for block in self.table
        )


def _errors(meaning: str, *table: ErrorBlock) -> type[ErrorSettings]:
    """Return the settings class of an error: spread and walk of each block, by default those in the table."""
    fields: dict[str, Any] = {}
    for block in table:
        unit = block.quantities[0].unit
        spread = _Share if unit == "1" else Annotated[float, Amount(unit), _SPREAD]
        fields[f"{block.prefix}spread"] = spread, block.prior_std
        fields[f"{block.prefix}walk"] = Annotated[float, Amount(f"{unit}/s^0.5"), _WALK], block.walk
    name = f"ErrorSettings[{', '.join(block.name for block in table)}]"
    settings = make_settings(name, __name__, ErrorSettings, meaning, **fields)
    settings.table = table
    return settings


class DvlArmErrors(ErrorSettings):
    """Position of the DVL relative to the vehicle's origin (lever arm)."""

    table = tuple(ErrorBlock(quantity.symbol, (quantity,), "dvl") for quantity in DVL_ARM)
    axes: Annotated[
        tuple[Literal["x", "y", "z"], ...],
        Field(min_length=1, description="components to estimate: forward, starboard, down"),
    ] = ("x",)
    spread: Annotated[float, Amount("m"), _SPREAD] = 0.3
    walk: Annotated[float, Amount("m/s^0.5"), _WALK] = 0.0

    def blocks(self) -> tuple[ErrorBlock, ...]:
        """Return the blocks of the chosen axes."""
        return tuple(block for axis, block in zip("xyz", super().blocks(), strict=True) if axis in self.axes)


class FinTrimErrors(ErrorSettings):
    """Constant offset between actual and recorded fin angle."""

    table = tuple(ErrorBlock(quantity.symbol, (quantity,)) for quantity in FIN_TRIMS)
    fins: Annotated[
        tuple[Literal["rudder", "elevator"], ...], Field(min_length=1, description="fins with a trim to estimate")
    ] = ("rudder", "elevator")
    spread: Annotated[float, Amount("rad"), _SPREAD] = 0.05
    walk: Annotated[float, Amount("rad/s^0.5"), _WALK] = 0.0

    def blocks(self) -> tuple[ErrorBlock, ...]:
        """Return the blocks of the chosen fins."""
        return tuple(b for fin, b in zip(("rudder", "elevator"), super().blocks(), strict=True) if fin in self.fins)


class DelayError(Settings):
    """Constant time delays of inputs (command to effect) and of sensors (time stamp minus time of measurement)."""

    of: Annotated[
        tuple[DelayedName, ...],
        Field(min_length=1, description="delays to estimate, on top of those that `identification.delays` states"),
    ] = ("inputs",)
    spread: Annotated[
        float, Amount("s"), Field(gt=0, le=10, description="standard deviation of the error before any data")
    ] = 0.1

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


_SCALE = _components("accelerometer", "scale", "scale error", unit="1")
# Settings class of each error.
_SETTINGS: dict[BiasName, Any] = {
    BiasName.GYRO: _errors("Bias of the gyroscope, three components.", _bias("gyroscope", 0.01)),
    BiasName.ATTITUDE: _errors("Offsets of roll, pitch and heading.", _bias("attitude", 0.05)),
    BiasName.ACCELEROMETER: _errors(
        "Bias of the accelerometer, three components.", _bias("accelerometer", 0.05, additive=False)
    ),
    BiasName.ACCELEROMETER_SCALE: _errors(
        "Scale errors of the accelerometer, three axes.",
        ErrorBlock("accelerometer_scale", _SCALE, "accelerometer", 0.01),
    ),
    BiasName.MAGNETOMETER: _errors("Offset of the compass.", _bias("magnetometer", 0.05)),
    BiasName.MAGNETIC_FIELD: _errors(
        "Magnetic field of the vehicle in its own axes (hard iron).", _bias("magnetic_field", 5e-6, additive=False)
    ),
    BiasName.DVL: _errors(
        "Scale error and mounting yaw of the DVL.",
        ErrorBlock("dvl_scale", (DVL_SCALE,), "dvl", 0.05, prefix="scale_"),
        ErrorBlock("dvl_yaw", (DVL_YAW,), "dvl", 0.05, prefix="yaw_"),
    ),
    BiasName.DVL_ARM: DvlArmErrors,
    BiasName.CURRENT: _errors(
        "Horizontal current, north and east, in the velocity over ground that a DVL measures.",
        ErrorBlock("current", CURRENT, "dvl", 0.3, 1e-3),
    ),
    BiasName.THRUST: _errors(
        "Scale error of the stated surge force, for example of a propeller with a guessed gain.",
        ErrorBlock("thrust", (THRUST_SCALE,), None, 0.3),
    ),
    BiasName.FIN_TRIM: FinTrimErrors,
    BiasName.BALLAST: _errors(
        "Errors of weight, buoyancy and their centres: a vertical force and a pitching moment.",
        ErrorBlock("excess_buoyancy", (EXCESS_BUOYANCY,), None, 10.0, prefix="buoyancy_"),
        ErrorBlock("trim_moment", (TRIM_MOMENT,), None, 5.0, prefix="moment_"),
    ),
    BiasName.DELAY: DelayError,
    BiasName.DISTURBANCE: EstimatedDisturbance,
}


@with_fields(**{name.value: (settings, settings()) for name, settings in _SETTINGS.items()})
class AugmentedStates(Settings):
    """Errors to estimate next to coefficients and motion."""

    biases: Annotated[
        tuple[BiasName, ...],
        Field(description="errors to estimate, any of " + ", ".join(f"`{name}`" for name in BiasName)),
    ] = ()
    if TYPE_CHECKING:
        delay: DelayError = DelayError()
        disturbance: EstimatedDisturbance = EstimatedDisturbance()

    def blocks_of(self, name: BiasName) -> tuple[ErrorBlock, ...]:
        """Return the blocks of one error, whether it is to be estimated or not."""
        return getattr(self, name.value).blocks()

    def blocks(self) -> tuple[ErrorBlock, ...]:
        """Return the blocks to estimate, each once."""
        return tuple(block for name in dict.fromkeys(self.biases) for block in self.blocks_of(name))

    def without_effect(self) -> tuple[str, ...]:
        """Return the names of errors that are not estimated, although their settings differ from the defaults."""
        fields = type(self).model_fields
        unused = (name.value for name in BiasName if name not in self.biases)
        return tuple(name for name in unused if getattr(self, name) != fields[name].default)


_EVERYTHING = AugmentedStates.model_validate(
    {
        "biases": tuple(BiasName),
        "dvl_arm": {"axes": ("x", "y", "z")},
        "delay": {"of": get_args(DelayedName)},
        "disturbance": {"force": {"standard_deviation": 1.0}, "moment": {"standard_deviation": 1.0}},
    }
)
# Every block that settings can select, with the default of its spread.
ERROR_BLOCKS = _EVERYTHING.blocks()
ERROR_STATES = tuple(quantity for block in ERROR_BLOCKS for quantity in block.quantities)
