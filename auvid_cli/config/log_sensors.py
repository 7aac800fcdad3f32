"""Settings of a log map: what each sensor's numbers are, and in which axes they are."""

from difflib import get_close_matches
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

from pydantic import BeforeValidator, Field, create_model, field_validator, model_validator

from auvid_cli.config.log_columns import LOG_SIGNALS, LogRows, LogSignal, Number, RowChoice, check_unit
from auvid_cli.config.sensors import EarthField
from auvid_cli.config.settings import Lever, Settings, Spans
from auvid_cli.config.units import Unit, check_amount, parse_components
from auvid_cli.vehicle.parameters import SENSORS


def _axes(value: Any) -> Any:
    """Name the axes that were meant where the text is no name of any."""
    known = ("FRD", "FLU", "NED", "ENU")
    near = get_close_matches(value.upper(), known, n=1) if isinstance(value, str) and value not in known else ()
    if near:
        raise ValueError(f"{value!r} is no name of axes; did you mean {near[0]!r}?")
    return value


BodyAxes = Annotated[Literal["FRD", "FLU"], BeforeValidator(_axes)]
EarthAxes = Annotated[Literal["NED", "ENU"], BeforeValidator(_axes)]
AnyAxes = Annotated[Literal["FRD", "FLU", "NED", "ENU"], BeforeValidator(_axes)]


MOUNTS = {"upside down": {"roll": "180 deg"}, "backward": {"yaw": "180 deg"}}


class Mount(Settings):
    """Attitude of a sensor in the body: yaw, then pitch, then roll; or `upside down`, or `backward`."""

    roll: Annotated[float, Unit("rad"), Field(description="about the forward axis")] = 0.0
    pitch: Annotated[float, Unit("rad"), Field(description="about the starboard axis")] = 0.0
    yaw: Annotated[float, Unit("rad"), Field(description="about the downward axis")] = 0.0

    @model_validator(mode="before")
    @classmethod
    def _accept_a_name(cls, data: Any) -> Any:
        if isinstance(data, str):
            if data not in MOUNTS:
                raise ValueError(f"expected {', '.join(MOUNTS)}, or angles as {{roll: 180 deg}}, got {data!r}")
            return MOUNTS[data]
        return data

    def angles(self) -> tuple[float, float, float]:
        """Return roll, pitch and yaw, rad."""
        return self.roll, self.pitch, self.yaw


class Columns(Settings):
    """A signal for each component, as far as the log has it."""

    @model_validator(mode="after")
    def _at_least_one(self) -> "Columns":
        if not self.signals():
            raise ValueError(f"expected a column for at least one of {', '.join(type(self).model_fields)}")
        return self

    def signals(self) -> dict[str, LogSignal]:
        """Return the signals by component, of the components that are given."""
        given = {symbol: getattr(self, symbol) for symbol in type(self).model_fields}
        return {symbol: signal for symbol, signal in given.items() if signal is not None}


def _columns_of(sensor: str) -> type[Columns]:
    """Make the settings that name a column for each component of a sensor."""
    fields: dict[str, Any] = {
        q.symbol: (LOG_SIGNALS[q.unit] | None, Field(None, description=q.meaning)) for q in SENSORS[sensor]
    }
    words = f"Columns of the components of `{sensor}`, as far as the log has them."
    return create_model("Columns", __base__=Columns, __doc__=words, **fields)


if TYPE_CHECKING:
    Rates = Columns
    SpecificForces = Columns
    Heading = Columns
    Fields = Columns
    Velocity = Columns
    Angles = Columns
    Down = Columns
else:
    Rates, SpecificForces, Heading, Fields, Velocity, Angles, Down = map(
        _columns_of, ("gyroscope", "accelerometer", "magnetometer", "magnetic_field", "dvl", "attitude", "depth")
    )


class SensorMap(LogRows):
    """Settings of every sensor."""

    sensor: ClassVar[str]
    if TYPE_CHECKING:
        columns: Any

    unit: Annotated[str | None, Field(description="of all columns that state none themselves")] = None
    standard_deviation: Annotated[
        tuple[float, ...] | Literal["estimate"],
        Field(description="of the noise, one for all or one per component, or 'estimate'"),
    ]
    valid: Annotated[RowChoice | None, Field(description="column that says which rows are valid")] = None
    repeats: Annotated[
        Literal["keep", "drop"],
        Field(description="drop: rows that only repeat the one before, as where a faster table holds the last value"),
    ] = "keep"
    exclude: Annotated[Spans, Field(description="[begin, end] in the dataset's time: missing")] = ()

    @field_validator("unit", mode="after")
    @classmethod
    def _known_unit(cls, unit: str | None) -> str | None:
        return check_unit(unit, SENSORS[cls.sensor][0].unit)

    @field_validator("standard_deviation", mode="before")
    @classmethod
    def _per_component(cls, value: Any) -> Any:
        if value == "estimate":
            return value
        quantities = SENSORS[cls.sensor]
        try:
            deviations = parse_components(value, quantities[0].unit, len(quantities), check_amount)
        except ValueError as error:
            raise ValueError(f"{error}; 'estimate' takes it from the signal") from None
        if any(deviation <= 0.0 for deviation in deviations):
            raise ValueError("expected standard deviations greater than 0")
        return deviations * (len(quantities) // len(deviations))

    def signals(self) -> dict[str, LogSignal]:
        """Return the signals by component."""
        return self.columns.signals()


class InBody(SensorMap):
    """A sensor that measures along axes of its own."""

    frame: Annotated[BodyAxes, Field(description="forward, right, down; or forward, left, up")] = "FRD"
    mount: Annotated[Mount | None, Field(description="if its axes are not the body's")] = None


class GyroscopeMap(InBody):
    """Angular rates."""

    sensor = "gyroscope"
    columns: Rates


class AccelerometerMap(InBody):
    """Specific force."""

    sensor = "accelerometer"
    columns: SpecificForces
    position: Annotated[
        Lever, Field(description="[forward, starboard, down] from the vehicle's origin; estimators use it")
    ] = (0.0, 0.0, 0.0)


class MagneticFieldMap(EarthField, InBody):
    """Magnetic field along three axes."""

    sensor = "magnetic_field"
    columns: Fields


class MagnetometerMap(SensorMap):
    """Heading of a compass."""

    sensor = "magnetometer"
    columns: Heading
    reference: Annotated[EarthAxes, Field(description="from north clockwise, or from east anticlockwise")] = "NED"


class DvlMap(SensorMap):
    """Velocity, along axes of its own or of the earth."""

    sensor = "dvl"
    columns: Velocity
    frame: Annotated[AnyAxes, Field(description="NED and ENU: turned into the body by the attitude")] = "FRD"
    mount: Annotated[Mount | None, Field(description="if its axes are not the body's")] = None
    position: Annotated[
        Lever | None,
        Field(description="[forward, starboard, down] from the vehicle's origin: its own motion is taken off"),
    ] = None

    @model_validator(mode="after")
    def _one_frame(self) -> "DvlMap":
        if self.mount is not None and self.frame in ("NED", "ENU"):
            raise ValueError(f"a velocity in {self.frame} axes needs no mount")
        return self


class Quaternion(Settings):
    """Columns of a quaternion that turns vectors of the sensor's axes into the earth's; a name stands for name.w ..."""

    w: Number
    x: Number
    y: Number
    z: Number

    @model_validator(mode="before")
    @classmethod
    def _accept_a_name(cls, data: Any) -> Any:
        return {axis: f"{data}.{axis}" for axis in "wxyz"} if isinstance(data, str) else data


class AttitudeMap(InBody):
    """Roll, pitch and yaw, as angles or as a quaternion."""

    sensor = "attitude"
    columns: Angles | None = None
    quaternion: Quaternion | None = None
    reference: Annotated[EarthAxes, Field(description="axes of the earth that it refers to")] = "NED"

    @model_validator(mode="after")
    def _angles_or_quaternion(self) -> "AttitudeMap":
        if (self.columns is None) == (self.quaternion is None):
            raise ValueError("expected either 'columns' (phi, theta, psi) or 'quaternion'")
        if self.quaternion is not None and self.unit is not None:
            raise ValueError("a quaternion has no unit")
        return self

    def signals(self) -> dict[str, LogSignal]:
        """Return the signals by component, of the angles or of the quaternion."""
        if self.quaternion is None:
            return super().signals()
        return {axis: getattr(self.quaternion, axis) for axis in "wxyz"}


class DepthMap(SensorMap):
    """Depth."""

    sensor = "depth"
    columns: Down
    position: Annotated[
        Lever | None,
        Field(description="[forward, starboard, down] from the vehicle's origin: its depth by the attitude"),
    ] = None


class _SensorMaps(Settings):
    """The sensors that the logs hold."""

    gyroscope: GyroscopeMap | None = None
    accelerometer: AccelerometerMap | None = None
    magnetometer: MagnetometerMap | None = None
    magnetic_field: MagneticFieldMap | None = None
    dvl: DvlMap | None = None
    attitude: AttitudeMap | None = None
    depth: DepthMap | None = None

    @model_validator(mode="after")
    def _at_least_one(self) -> "SensorMaps":
        if not self.given():
            raise ValueError(f"expected at least one of {', '.join(type(self).model_fields)}")
        return self

    def given(self) -> dict[str, SensorMap]:
        """Return the sensors that are given, by name."""
        sensors = {name: getattr(self, name) for name in type(self).model_fields}
        return {name: sensor for name, sensor in sensors.items() if sensor is not None}


def _plain_map(sensor: str) -> type[SensorMap]:
    """Make the map of a sensor that has no axes, lever arm or reference of its own to be told of."""

    class PlainMap(SensorMap):
        columns: _columns_of(sensor)  # type: ignore[valid-type]

    PlainMap.sensor = sensor
    return PlainMap


if TYPE_CHECKING:
    SensorMaps = _SensorMaps
else:
    SensorMaps = create_model(
        "SensorMaps",
        __base__=_SensorMaps,
        __doc__=_SensorMaps.__doc__,
        **{name: (_plain_map(name) | None, None) for name in SENSORS if name not in _SensorMaps.model_fields},
    )
