"""Errors of sensors, actuators and vehicle that are estimated as states next to the coefficients.

`ROWS` is the table of constant or slowly drifting errors: one row makes the settings, the states and their prior. The
current is a row of the DVL, because it is an error of a DVL that would measure the motion through the water. Time
delays and the disturbance have settings of another kind and follow the table.
"""

from enum import StrEnum
from math import inf, sqrt
from typing import Annotated, Any, ClassVar, Literal, NamedTuple, get_args

from pydantic import Field, create_model

from auvid_cli.config.moving_states import Disturbance
from auvid_cli.config.settings import Settings
from auvid_cli.config.units import Amount
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
SPREAD = "standard deviation before any data"
WALK = "growth per square root of a second; 0: constant"


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
    """States of one error.

    Attributes
    ----------
    name : str
    quantities : tuple of Quantity
    prior_std : float
        Standard deviation of each before any data, SI.
    walk : float
        Growth per square root of a second, SI; 0 for a constant.
    sensor : str or None
        Sensor with this error; None for errors of actuators and vehicle, which act on the process.
    additive : bool
        Whether it adds, component by component, to states that the sensor measures directly; otherwise compiled code
        of `auvid_cli.identification` names each of its symbols.
    time_constant : float
        Time after which 1/e of it is left, s; infinite for a constant or a random walk.
    shifts : bool
        Whether it is a delay: not a state of a filter, but estimated by `auvid_cli.identification.delays`.
    prefix : str
        Start of the keys of its spread and walk.
    """

    name: str
    quantities: tuple[Quantity, ...]
    prior_std: float
    walk: float
    sensor: str | None
    additive: bool = False
    time_constant: float = inf
    is_delay: bool = False
    prefix: str = ""

    @property
    def is_named(self) -> bool:
        """Whether compiled code names each of its symbols."""
        return not self.additive and not self.is_delay and self.time_constant == inf

    def split(self) -> tuple["ErrorBlock", ...]:
        """Return one block for each state."""
        return tuple(self._replace(name=quantity.symbol, quantities=(quantity,)) for quantity in self.quantities)


class Choice(NamedTuple):
    """Setting that selects states of a block; `annotation` names all of them in their order."""

    key: str
    annotation: Any
    default: tuple[str, ...]
    description: str


class ErrorRow(NamedTuple):
    """Section of the settings with its summary, states with the default spread and walk, and a choice among them."""

    key: BiasName
    meaning: str
    block: ErrorBlock
    choice: Choice | None = None


def _components(sensor: str, prefix: str, words: str, unit: str | None = None) -> tuple[Quantity, ...]:
    """Return one error for each component of a sensor."""
    return tuple(
        Quantity(f"{prefix}_{q.symbol}", unit or q.unit, f"{words} of the measured {q.meaning}", "measurement")
        for q in SENSORS[sensor]
    )


def _bias(sensor: str, spread: float, additive: bool = True) -> ErrorBlock:
    """Return a constant offset of each component of a sensor."""
    return ErrorBlock(f"{sensor}_bias", _components(sensor, "bias", "bias"), spread, 0.0, sensor, additive)


_SCALES = _components("accelerometer", "scale", "scale error", unit="1")
_DVL = "Scale error and mounting yaw of the DVL."
_BALLAST = "Errors of weight, buoyancy and their centres: a vertical force and a pitching moment."
_AXES = Choice("axes", tuple[Literal["x", "y", "z"], ...], ("x",), "components to estimate: forward, starboard, down")
_FINS = Choice(
    "fins", tuple[Literal["rudder", "elevator"], ...], ("rudder", "elevator"), "fins with a trim to estimate"
)
# fmt: off
ROWS = (
    ErrorRow(BiasName.GYRO, "Bias of the gyroscope, three components.", _bias("gyroscope", 0.01)),
    ErrorRow(BiasName.ATTITUDE, "Offsets of roll, pitch and heading.", _bias("attitude", 0.05)),
    ErrorRow(BiasName.ACCELEROMETER, "Bias of the accelerometer, three components.",
             _bias("accelerometer", 0.05, additive=False)),
    ErrorRow(BiasName.ACCELEROMETER_SCALE, "Scale errors of the accelerometer, three axes.",
             ErrorBlock("accelerometer_scale", _SCALES, 0.01, 0.0, "accelerometer")),
    ErrorRow(BiasName.MAGNETOMETER, "Offset of the compass.", _bias("magnetometer", 0.05)),
    ErrorRow(BiasName.MAGNETIC_FIELD, "Magnetic field of the vehicle in its own axes (hard iron), which turns with it.",
             _bias("magnetic_field", 5e-6, additive=False)),
    ErrorRow(BiasName.DVL, _DVL, ErrorBlock("dvl_scale", (DVL_SCALE,), 0.05, 0.0, "dvl", prefix="scale_")),
    ErrorRow(BiasName.DVL, _DVL, ErrorBlock("dvl_yaw", (DVL_YAW,), 0.05, 0.0, "dvl", prefix="yaw_")),
    ErrorRow(BiasName.DVL_ARM, "Position of the DVL relative to the vehicle's origin (lever arm).",
             ErrorBlock("dvl_arm", DVL_ARM, 0.3, 0.0, "dvl"), _AXES),
    ErrorRow(BiasName.CURRENT, "Horizontal current, north and east, in the velocity over ground that a DVL measures.",
             ErrorBlock("current", CURRENT, 0.3, 1e-3, "dvl")),
    ErrorRow(BiasName.THRUST, "Scale error of the stated surge force, for example of a propeller with a guessed gain.",
             ErrorBlock("thrust", (THRUST_SCALE,), 0.3, 0.0, None)),
    ErrorRow(BiasName.FIN_TRIM, "Constant offset between actual and recorded fin angle.",
             ErrorBlock("fin_trim", FIN_TRIMS, 0.05, 0.0, None), _FINS),
    ErrorRow(BiasName.BALLAST, _BALLAST,
             ErrorBlock("excess_buoyancy", (EXCESS_BUOYANCY,), 10.0, 0.0, None, prefix="buoyancy_")),
    ErrorRow(BiasName.BALLAST, _BALLAST, ErrorBlock("trim_moment", (TRIM_MOMENT,), 5.0, 0.0, None, prefix="moment_")),
)
# fmt: on


class ErrorSettings(Settings):
    """Settings of the rows with one key."""

    rows: ClassVar[tuple[ErrorRow, ...]]

    def blocks(self) -> tuple[ErrorBlock, ...]:
        """Return the blocks of states with the spread and walk of these settings."""
        blocks = []
        for _, _, default, choice in self.rows:
            spread, walk = getattr(self, f"{default.prefix}spread"), getattr(self, f"{default.prefix}walk")
            block = default._replace(prior_std=spread, walk=walk)
            if choice is None:
                blocks.append(block)
            else:
                names, chosen = get_args(get_args(choice.annotation)[0]), getattr(self, choice.key)
                blocks += [part for name, part in zip(names, block.split(), strict=True) if name in chosen]
        return tuple(blocks)


def _settings_class(key: BiasName) -> type[ErrorSettings]:
    """Make the settings class of the rows with one key."""
    rows, fields = tuple(row for row in ROWS if row.key == key), {}
    for _, _, block, choice in rows:
        unit = block.quantities[0].unit
        share = Annotated[float, Field(ge=1e-9, le=1e3, description=SPREAD)]
        amount = Annotated[float, Amount(unit), Field(gt=0, description=SPREAD)]
        walk = Annotated[float, Amount(f"{unit}/s^0.5"), Field(ge=0, description=WALK)]
        if choice is not None:
            limits = Field(min_length=1, description=choice.description)
            fields[choice.key] = Annotated[choice.annotation, limits], choice.default
        fields[f"{block.prefix}spread"] = share if unit == "1" else amount, block.prior_std
        fields[f"{block.prefix}walk"] = walk, block.walk
    name = f"{key.title().replace('_', '')}Errors"
    made = create_model(name, __base__=ErrorSettings, __doc__=rows[0].meaning, __module__=__name__, **fields)
    made.rows = rows
    # Settings are pickled for other processes, and pickle looks a class up by its name in its module.
    globals()[name] = made
    return made


_SECTIONS: dict[str, Any] = {
    key.value: (made, made()) for key in dict.fromkeys(row.key for row in ROWS) for made in (_settings_class(key),)
}


class DelayError(Settings):
    """Constant time delays of inputs (command to effect) and of sensors (time stamp minus time of measurement)."""

    of: Annotated[
        tuple[DelayedName, ...],
        Field(min_length=1, description="delays to estimate, on top of those that `identification.delays` states"),
    ] = ("inputs",)
    spread: Annotated[float, Amount("s"), Field(gt=0, le=10, description=SPREAD)] = 0.1

    def blocks(self) -> tuple[ErrorBlock, ...]:
        """Return one block for each delay."""
        return tuple(
            ErrorBlock(delay.symbol, (delay,), self.spread, 0.0, None, is_delay=True)
            for name, delay in DELAYS.items()
            if name in self.of
        )


class EstimatedDisturbance(Disturbance):
    """Gauss-Markov force and moment that the model lacks, one state for each axis with a standard deviation."""

    def blocks(self) -> tuple[ErrorBlock, ...]:
        """Return the blocks of the axes; each is stationary, since its noise replaces the part that decays."""
        return tuple(
            _disturbance_block(quantity, size, time)
            for quantity, (size, time) in zip(DISTURBANCE, self.per_axis(), strict=True)
            if size > 0.0
        )


def _disturbance_block(quantity: Quantity, size: float, time: float) -> ErrorBlock:
    return ErrorBlock(quantity.symbol, (quantity,), size, size * sqrt(2.0 / time), None, time_constant=time)


class _BiasList(Settings):
    """Names of the blocks to estimate."""

    biases: Annotated[
        tuple[BiasName, ...],
        Field(description="blocks of further states: " + ", ".join(f"`{name}`" for name in BiasName)),
    ] = ()


class AugmentedStates(create_model("_TableStates", __base__=_BiasList, **_SECTIONS)):
    """Errors to estimate next to coefficients and motion."""

    delay: DelayError = DelayError()
    disturbance: EstimatedDisturbance = EstimatedDisturbance()

    def blocks_of(self, name: BiasName) -> tuple[ErrorBlock, ...]:
        """Return the blocks of one error, whether it is to be estimated or not."""
        return getattr(self, name.value).blocks()

    def blocks(self) -> tuple[ErrorBlock, ...]:
        """Return the blocks to estimate, each once."""
        return tuple(block for name in dict.fromkeys(self.biases) for block in self.blocks_of(name))


# Every block that settings can select, with the default of its spread.
ERROR_BLOCKS = (
    *(block for row in ROWS for block in (row.block.split() if row.choice else (row.block,))),
    *DelayError(of=get_args(DelayedName)).blocks(),
    *(_disturbance_block(quantity, 1.0, 5.0) for quantity in DISTURBANCE),
)
ERROR_STATES = tuple(quantity for block in ERROR_BLOCKS for quantity in block.quantities)
