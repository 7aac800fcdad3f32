"""Settings by which a vehicle's logs become a dataset: logs, sensors and their axes."""

from collections.abc import Sequence
from difflib import get_close_matches
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

from pydantic import BeforeValidator, Field, create_model, field_validator, model_validator

from auvid_cli.config.experiment import RunName, WithVehicle
from auvid_cli.config.identification import Identification, IdentificationOfVehicle
from auvid_cli.config.loading import assemble, open_source, validated
from auvid_cli.config.log_columns import (
    LOG_SIGNALS,
    InputsMap,
    LogRows,
    LogSignal,
    Number,
    RowChoice,
    TimeSource,
    check_unit,
)
from auvid_cli.config.sensors import EarthField
from auvid_cli.config.settings import Lever, Settings, Spans
from auvid_cli.config.source_positions import Tree
from auvid_cli.config.units import Unit, check_amount, parse_components
from auvid_cli.config.vehicle import VehicleSettings
from auvid_cli.errors import ConfigError
from auvid_cli.vehicle.parameters import SENSORS


def _axes(value: Any) -> Any:
    """Return the value unchanged; ValueError with a suggestion if it resembles a name of axes."""
    axes = ("FRD", "FLU", "NED", "ENU")
    near = get_close_matches(value.upper(), axes, n=1) if isinstance(value, str) and value not in axes else ()
    if near:
        raise ValueError(f"unknown axes {value!r}; did you mean {near[0]!r}?")
    return value


BodyAxes = Annotated[Literal["FRD", "FLU"], BeforeValidator(_axes)]
EarthAxes = Annotated[Literal["NED", "ENU"], BeforeValidator(_axes)]
AnyAxes = Annotated[Literal["FRD", "FLU", "NED", "ENU"], BeforeValidator(_axes)]
MOUNTS = {"upside down": {"roll": "180 deg"}, "backward": {"yaw": "180 deg"}}


class Mount(Settings):
    """Attitude of a sensor in the body: turns by yaw, pitch and roll, in this order; or `upside down` or `backward`."""

    roll: Annotated[float, Unit("rad"), Field(description="angle about the forward axis")] = 0.0
    pitch: Annotated[float, Unit("rad"), Field(description="angle about the starboard axis")] = 0.0
    yaw: Annotated[float, Unit("rad"), Field(description="angle about the downward axis")] = 0.0

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
    """A signal for each component that the log has."""

    @model_validator(mode="after")
    def _at_least_one(self) -> "Columns":
        if not self.given():
            raise ValueError(f"expected a column for at least one of {', '.join(type(self).model_fields)}")
        return self


def _columns_of(sensor: str) -> type[Columns]:
    """Return the settings class with a column for each component of a sensor."""
    fields: dict[str, Any] = {
        q.symbol: (LOG_SIGNALS[q.unit] | None, Field(None, description=q.meaning)) for q in SENSORS[sensor]
    }
    words = f"Columns of the components of `{sensor}` that the log has."
    return create_model("Columns", __base__=Columns, __doc__=words, **fields)


class SensorMap(LogRows):
    """Settings that all sensors share."""

    sensor: ClassVar[str] = ""
    if TYPE_CHECKING:
        columns: Any

    def __init_subclass__(cls, sensor: str = "", **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        cls.sensor = sensor

    unit: Annotated[str | None, Field(description="default unit of the columns")] = None
    standard_deviation: Annotated[
        tuple[float, ...] | Literal["estimate"],
        Field(description="standard deviation of the noise, one for all or one per component, or 'estimate'"),
    ]
    valid: Annotated[RowChoice | None, Field(description="column that marks valid rows")] = None
    missing: Annotated[
        tuple[float, ...], Field(description="numbers of the log that mean a missing measurement, such as -32768")
    ] = ()
    zeros: Annotated[
        Literal["keep", "drop"],
        Field(description="drop: rows in which all components are exactly zero are missing measurements"),
    ] = "keep"
    repeats: Annotated[
        Literal["keep", "drop"],
        Field(description="drop: leave out rows that repeat the row before, if the table has a higher rate"),
    ] = "keep"
    exclude: Annotated[Spans, Field(description="spans [begin, end] without this sensor, in the dataset's time")] = ()

    @model_validator(mode="before")
    @classmethod
    def _deviations_of_present_columns(cls, data: Any) -> Any:
        """Accept one standard deviation for each column that the log has."""
        columns = data.get("columns") if isinstance(data, dict) else None
        deviations = data.get("standard_deviation") if isinstance(data, dict) else None
        symbols = [quantity.symbol for quantity in SENSORS[cls.sensor]]
        if not isinstance(columns, dict) or not isinstance(deviations, list | tuple):
            return data
        present = [symbol for symbol in symbols if symbol in columns]
        if len(deviations) != len(present) or len(present) == len(symbols):
            return data
        # Components that are never measured need a number, too.
        by_symbol = dict(zip(present, deviations, strict=True))
        return {**data, "standard_deviation": [by_symbol.get(symbol, deviations[0]) for symbol in symbols]}

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
            raise ValueError(f"{error}; 'estimate' computes it from the signal") from None
        if any(deviation <= 0.0 for deviation in deviations):
            raise ValueError("expected standard deviations greater than 0")
        return deviations * (len(quantities) // len(deviations))

    def signals(self) -> dict[str, LogSignal]:
        """Return the signals by component."""
        return self.columns.given()


class InBody(SensorMap):
    """A sensor with its own axes."""

    frame: Annotated[BodyAxes, Field(description="axes: forward, right, down; or forward, left, up")] = "FRD"
    mount: Annotated[Mount | None, Field(description="attitude of the sensor in the body")] = None


class GyroscopeMap(InBody, sensor="gyroscope"):
    """Angular rates."""

    columns: _columns_of("gyroscope")  # type: ignore[valid-type]


class AccelerometerMap(InBody, sensor="accelerometer"):
    """Specific force."""

    columns: _columns_of("accelerometer")  # type: ignore[valid-type]
    position: Annotated[
        Lever, Field(description="[forward, starboard, down] from the vehicle's origin; used by estimators")
    ] = (0.0, 0.0, 0.0)


class MagneticFieldMap(EarthField, InBody, sensor="magnetic_field"):
    """Magnetic field along three axes."""

    columns: _columns_of("magnetic_field")  # type: ignore[valid-type]


class MagnetometerMap(SensorMap, sensor="magnetometer"):
    """Heading of a compass."""

    columns: _columns_of("magnetometer")  # type: ignore[valid-type]
    reference: Annotated[
        EarthAxes, Field(description="zero and sense: from north clockwise (NED), or from east anticlockwise (ENU)")
    ] = "NED"


class DvlMap(SensorMap, sensor="dvl"):
    """Velocity along the axes of the sensor or of the earth."""

    columns: _columns_of("dvl")  # type: ignore[valid-type]
    frame: Annotated[AnyAxes, Field(description="axes; NED and ENU are rotated into the body by the attitude")] = "FRD"
    mount: Annotated[Mount | None, Field(description="attitude of the sensor in the body")] = None
    position: Annotated[
        Lever | None,
        Field(description="[forward, starboard, down] from the vehicle's origin; lever-arm velocity is removed"),
    ] = None

    @model_validator(mode="after")
    def _one_frame(self) -> "DvlMap":
        if self.mount is not None and self.frame in ("NED", "ENU"):
            raise ValueError(f"mount: not possible for a velocity in {self.frame} axes")
        return self


class Quaternion(Settings):
    """Columns of a quaternion from the sensor's to the earth's axes; a bare name means name.w, name.x and so on."""

    w: Number
    x: Number
    y: Number
    z: Number

    @model_validator(mode="before")
    @classmethod
    def _accept_a_name(cls, data: Any) -> Any:
        return {axis: f"{data}.{axis}" for axis in "wxyz"} if isinstance(data, str) else data


class AttitudeMap(InBody, sensor="attitude"):
    """Roll, pitch and yaw, as angles or as a quaternion."""

    columns: _columns_of("attitude") | None = None  # type: ignore[valid-type]
    quaternion: Quaternion | None = None
    reference: Annotated[EarthAxes, Field(description="axes of the earth")] = "NED"

    @model_validator(mode="after")
    def _angles_or_quaternion(self) -> "AttitudeMap":
        if (self.columns is None) == (self.quaternion is None):
            raise ValueError("expected either 'columns' (phi, theta, psi) or 'quaternion'")
        if self.quaternion is not None and self.unit is not None:
            raise ValueError("a quaternion has no unit")
        return self

    def signals(self) -> dict[str, LogSignal]:
        """Return the signals by component, of the angles or of the quaternion."""
        return super().signals() if self.quaternion is None else dict(self.quaternion)


class DepthMap(SensorMap, sensor="depth"):
    """Depth."""

    columns: _columns_of("depth")  # type: ignore[valid-type]
    position: Annotated[
        Lever | None,
        Field(description="[forward, starboard, down] from the vehicle's origin; the depth is corrected for it"),
    ] = None


class _SensorMaps(Settings):
    """Sensors in the logs."""

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


def plain_map(sensor: str) -> type[SensorMap]:
    """Return the settings class of a sensor without axes, lever arm or reference."""

    class _PlainMap(SensorMap, sensor=sensor):
        columns: _columns_of(sensor)  # type: ignore[valid-type]

    return _PlainMap


if TYPE_CHECKING:
    SensorMaps = _SensorMaps
else:
    SensorMaps = create_model(
        "SensorMaps",
        __base__=_SensorMaps,
        __doc__=_SensorMaps.__doc__,
        **{name: (plain_map(name) | None, None) for name in SENSORS if name not in _SensorMaps.model_fields},
    )


class LogFile(Settings):
    """A log, and the layout of its text if it cannot be recognised."""

    file: Annotated[str | None, Field(description="file, relative to the map; or given in the command")] = None
    more: Annotated[tuple[str, ...], Field(description="files that continue the log, in order")] = ()
    delimiter: Annotated[str | None, Field(min_length=1, description="separator of the fields of a row")] = None
    header_row: Annotated[
        int | None, Field(ge=1, strict=True, description="line of the names; the first line is 1")
    ] = None
    names: Annotated[tuple[str, ...], Field(description="names of the columns, if the file has none")] = ()
    decimal: Annotated[str | None, Field(pattern=r"^[.,]$", description="decimal point")] = None
    missing: Annotated[tuple[str, ...], Field(description="texts that mean a missing number")] = ()
    messages: Annotated[
        tuple[str, ...], Field(description="definitions of messages (.msg) that a ROS bag lacks, relative to the map")
    ] = ()

    @model_validator(mode="before")
    @classmethod
    def _accept_a_bare_file(cls, data: Any) -> Any:
        if isinstance(data, list) and data and all(isinstance(file, str) for file in data):
            return {"file": data[0], "more": data[1:]}
        return {"file": data} if isinstance(data, str) else data


class LogMap(WithVehicle):
    """A map file."""

    name: RunName
    vehicle: VehicleSettings
    identification: IdentificationOfVehicle = Identification()
    logs: Annotated[dict[str, LogFile], Field(min_length=1, description="log files, each under a name of your choice")]
    time: Annotated[TimeSource | None, Field(description="times; default: header stamp or log time")] = None
    use: Annotated[Spans, Field(description="spans [begin, end] to use, in the dataset's time; default: all")] = ()
    exclude: Annotated[Spans, Field(description="spans [begin, end] without sensors, in the dataset's time")] = ()
    sensors: SensorMaps
    inputs: InputsMap

    def files_in_map(self) -> list[Path]:
        """Return the paths of files that the map names."""
        return [Path(file) for log in self.logs.values() if log.file is not None for file in (log.file, *log.more)]

    def files(self, folder: Path, given: Sequence[str] = ()) -> dict[str, tuple[Path, ...]]:
        """Return the files of each log by its name.

        Parameters
        ----------
        folder : pathlib.Path
            Folder of relative paths in the map.
        given : sequence of str
            ``name=FILE``, several times for a log in several files, or files in the order of `logs`; they replace those
            in the map.

        Raises
        ------
        ConfigError
            If there are more files than logs, none for a log, or one for an unknown log.
        """
        names = ", ".join(self.logs)
        in_map = {
            name: tuple(folder / file for file in (log.file, *log.more))
            for name, log in self.logs.items()
            if log.file is not None
        }
        by_name: dict[str, tuple[Path, ...]] = {}
        by_order: dict[str, tuple[Path, ...]] = {}
        for index, text in enumerate(given):
            name, equals, file = text.partition("=")
            if equals and name in self.logs:
                by_name[name] = (*by_name.get(name, ()), Path(file))
            elif equals and name.isidentifier() and not Path(text).exists():
                raise ConfigError(f"{text}: unknown log {name!r}; expected one of {names}")
            elif index < len(self.logs):
                by_order[[*self.logs][index]] = (Path(text),)
            else:
                raise ConfigError(f"{text}: one file too many; the map has {len(self.logs)} logs: {names}")
        files = in_map | by_order | by_name
        for name in self.logs:
            if name not in files:
                raise ConfigError(f"no file for the log {name!r}; name one before --map, or in `logs` of the map")
        return files


def load_map(path: Path) -> tuple[LogMap, Tree]:
    """Read and validate a map file; also return its tree, for the positions of settings in messages.

    Raises
    ------
    ConfigError
        With all mistakes, each at its file, line and column.
    """
    tree, mistakes = assemble(open_source(path))
    return validated(LogMap, tree, mistakes), tree
