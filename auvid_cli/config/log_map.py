"""Settings by which a vehicle's logs become a dataset, with the model's inputs from fins and propeller."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, field_validator, model_validator

from auvid_cli.config.assembly import assemble
from auvid_cli.config.experiment import move_fin_lag
from auvid_cli.config.identification import Identification, IdentificationOfVehicle
from auvid_cli.config.loading import open_source, validated
from auvid_cli.config.log_columns import LogRows, PlacedSignal, TimeSource
from auvid_cli.config.log_sensors import SensorMaps
from auvid_cli.config.settings import Settings, Spans
from auvid_cli.config.source_positions import Tree
from auvid_cli.config.units import Amount, Unit, check_size, parse_quantity
from auvid_cli.config.vehicle import VehicleSettings
from auvid_cli.errors import ConfigError
from auvid_cli.vehicle.parameters import ALL_INPUTS


class InputSignal(PlacedSignal):
    """A signal of an input, or a constant; a bare number is a constant in SI."""

    column: Annotated[str, Field(description="name in the log")] = ""
    constant: Annotated[float | None, Field(description="such as 10.9 N, instead of a column")] = None

    @model_validator(mode="before")
    @classmethod
    def _accept_a_number(cls, data: Any) -> Any:
        return {"constant": data} if isinstance(data, int | float) and not isinstance(data, bool) else data

    @field_validator("constant", mode="before")
    @classmethod
    def _quantity_of_input(cls, value: Any) -> Any:
        return value if value is None else check_size(parse_quantity(value, cls.si), cls.si)

    @model_validator(mode="after")
    def _one_source(self) -> "InputSignal":
        if bool(self.column) == (self.constant is not None):
            raise ValueError("expected 'column' or 'constant', one of them")
        return self


class Fin(InputSignal):
    """Deflection of a fin, or of all that stand for one input."""

    si = "rad"


class Force(InputSignal):
    """A force."""

    si = "N"


class Moment(InputSignal):
    """A moment."""

    si = "N*m"


class Revolutions(InputSignal):
    """Revolutions per second of a propeller."""

    si = "turn/s"


class Voltage(InputSignal):
    """Voltage of the battery."""

    si = "V"


class Share(InputSignal):
    """A thruster's command in percent, or with the unit '1' as a fraction."""

    si = "percent"


class Fins(Settings):
    """Deflections of single fins: top, bottom, right, left, as many as there are; or the four of an X tail.

    A fin's deflection is positive if it pushes the tail to starboard, or up where it cannot push sideways; where the
    log counts the other way the sign is -1.
    """

    top: Annotated[Fin | None, Field(description="above the hull")] = None
    bottom: Annotated[Fin | None, Field(description="below the hull")] = None
    right: Annotated[Fin | None, Field(description="to starboard")] = None
    left: Annotated[Fin | None, Field(description="to port")] = None
    upper_right: Annotated[Fin | None, Field(description="of an X tail")] = None
    lower_right: Annotated[Fin | None, Field(description="of an X tail")] = None
    lower_left: Annotated[Fin | None, Field(description="of an X tail")] = None
    upper_left: Annotated[Fin | None, Field(description="of an X tail")] = None

    @model_validator(mode="after")
    def _one_tail(self) -> "Fins":
        names = set(self.given())
        diagonal = {name for name in names if "_" in name}
        if not names:
            raise ValueError(f"expected at least one of {', '.join(type(self).model_fields)}")
        if diagonal and (len(diagonal) < 4 or names - diagonal):
            raise ValueError("an X tail has upper_right, lower_right, lower_left and upper_left, and no other fins")
        return self

    def given(self) -> dict[str, Fin]:
        """Return the fins that are given, by name."""
        fins = {name: getattr(self, name) for name in type(self).model_fields}
        return {name: fin for name, fin in fins.items() if fin is not None}


class Thrust(Settings):
    """Thrust by F = a n|n| + b |n| u of a propeller, or F = full x|x| of a command x from -100 to 100 percent."""

    revolutions: Annotated[Revolutions | None, Field(description="n, in turn/s or rpm")] = None
    a: Annotated[float | None, Amount("N*s^2"), Field(gt=0, description="force at rest per (turn/s)^2")] = None
    b: Annotated[float, Unit("N*s^2/m"), Field(le=0, description="what speed takes off")] = 0.0
    share: Annotated[Share | None, Field(description="x, in percent, or with unit '1' where 1 is full")] = None
    full: Annotated[float | None, Amount("N"), Field(gt=0, description="force at 100 percent")] = None

    @model_validator(mode="after")
    def _one_law(self) -> "Thrust":
        by_revolutions = self.revolutions is not None and self.a is not None
        by_share = self.share is not None and self.full is not None
        mixed = (self.revolutions, self.a) != (None, None) and (self.share, self.full) != (None, None)
        if by_revolutions == by_share or mixed:
            raise ValueError("expected 'revolutions' with 'a', or 'share' with 'full'")
        if self.b and not by_revolutions:
            raise ValueError("'b' belongs to 'revolutions'")
        return self


class InputsMap(LogRows):
    """Inputs of the model; what is not given is zero. Log, table and time hold for all that state none."""

    rudder: Annotated[Fin | None, Field(description="positive pushes the tail to starboard")] = None
    elevator: Annotated[Fin | None, Field(description="positive pushes the tail up")] = None
    fins: Annotated[Fins | None, Field(description="single fins, instead of rudder and elevator")] = None
    surge_force: Annotated[Force | None, Field(description="thrust, where the log has it")] = None
    thrust: Annotated[Thrust | None, Field(description="law by which it follows from the propeller")] = None
    roll_moment: Annotated[
        Moment | Literal["propeller"] | None,
        Field(description="a column, or 'propeller': thrust times the vehicle's K_prop / X_prop"),
    ] = None
    revolutions: Annotated[
        Revolutions | None, Field(description="n itself, for terms of the vehicle that are made of it")
    ] = None
    voltage: Annotated[Voltage | None, Field(description="of the battery, for terms of the vehicle")] = None

    @model_validator(mode="before")
    @classmethod
    def _accept_a_bare_name(cls, data: Any) -> Any:
        moment = data.get("roll_moment") if isinstance(data, dict) else None
        if isinstance(moment, str) and moment != "propeller":
            return {**data, "roll_moment": {"column": moment}}
        return data

    @model_validator(mode="after")
    def _each_once(self) -> "InputsMap":
        if self.fins is not None and (self.rudder is not None or self.elevator is not None):
            raise ValueError("expected 'fins', or 'rudder' and 'elevator', not both")
        if self.thrust is not None and self.surge_force is not None:
            raise ValueError("expected 'thrust' or 'surge_force', not both")
        if not self._signals():
            raise ValueError(f"expected at least one of {', '.join(InputsMap.model_fields)}")
        return self

    def channels(self) -> dict[tuple[str, ...], InputSignal]:
        """Return the signals that the log has, by where they stand in the settings."""
        return {path: signal for path, signal in self._signals().items() if signal.constant is None}

    def constants(self) -> dict[tuple[str, ...], float]:
        """Return what is constant, in SI, by where it stands in the settings."""
        return {path: signal.constant for path, signal in self._signals().items() if signal.constant is not None}

    def _signals(self) -> dict[tuple[str, ...], InputSignal]:
        signals: dict[tuple[str, ...], Any] = {
            (quantity.symbol,): getattr(self, quantity.symbol) for quantity in ALL_INPUTS
        }
        if self.fins is not None:
            signals |= {("fins", name): fin for name, fin in self.fins.given().items()}
        if self.thrust is not None:
            signals |= {("thrust", name): getattr(self.thrust, name) for name in ("revolutions", "share")}
        return {path: signal for path, signal in signals.items() if isinstance(signal, InputSignal)}


class LogFile(Settings):
    """A log, and how its text is laid out if its reader is to be told."""

    file: Annotated[str | None, Field(description="relative to the map; may be left out if the command names it")] = (
        None
    )
    more: Annotated[tuple[str, ...], Field(description="files that continue it, in their order")] = ()
    delimiter: Annotated[str | None, Field(min_length=1, description="between the fields of a row")] = None
    header_row: Annotated[int | None, Field(ge=1, strict=True, description="line of the names, from 1")] = None
    names: Annotated[tuple[str, ...], Field(description="of the columns, where the file has none")] = ()
    decimal: Annotated[str | None, Field(pattern=r"^[.,]$", description="decimal point")] = None
    missing: Annotated[tuple[str, ...], Field(description="value that means a missing number")] = ()

    @model_validator(mode="before")
    @classmethod
    def _accept_a_bare_file(cls, data: Any) -> Any:
        if isinstance(data, list) and data and all(isinstance(file, str) for file in data):
            return {"file": data[0], "more": data[1:]}
        return {"file": data} if isinstance(data, str) else data


class LogMap(Settings):
    """A map file."""

    name: Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]*$", description="folder under results/")]
    vehicle: VehicleSettings
    identification: IdentificationOfVehicle = Identification()
    logs: Annotated[dict[str, LogFile], Field(min_length=1, description="files by a name of your choice")]
    time: Annotated[
        TimeSource | None, Field(description="where a sensor states none; else header stamp or log time")
    ] = None
    use: Annotated[Spans, Field(description="[begin, end] in the dataset's time; else all")] = ()
    exclude: Annotated[Spans, Field(description="[begin, end] in the dataset's time: missing in every sensor")] = ()
    sensors: SensorMaps
    inputs: InputsMap

    @model_validator(mode="before")
    @classmethod
    def _with_lag_of_vehicle(cls, data: Any) -> Any:
        return move_fin_lag(data)

    def files(self, folder: Path, given: Sequence[str] = ()) -> dict[str, tuple[Path, ...]]:
        """Return the files of the logs by name; of one that goes on in further files all of them, in order.

        Parameters
        ----------
        folder : pathlib.Path
            Folder of relative paths in the map.
        given : sequence of str
            ``name=FILE``, or files in the order of `logs`, instead of those that the map names.

        Raises
        ------
        ConfigError
            If there are more files than logs, none for a log, or one for a log that the map has not.
        """
        names = list(self.logs)
        files = {
            name: tuple(folder / file for file in (log.file, *log.more))
            for name, log in self.logs.items()
            if log.file is not None
        }
        named: dict[str, tuple[Path, ...]] = {}
        for place, text in enumerate(given):
            name, equals, file = text.partition("=")
            if equals and name in names:
                # Of a log that goes on in further files each is named.
                named[name] = (*named.get(name, ()), Path(file))
                files[name] = named[name]
            elif equals and name.isidentifier() and not Path(text).exists():
                raise ConfigError(f"{text}: the map has no log named {name!r}; it has {', '.join(names)}")
            elif place < len(names):
                files[names[place]] = (Path(text),)
            else:
                raise ConfigError(f"{text}: one file too many: the map knows {len(names)}, {', '.join(names)}")
        for name in names:
            if name not in files:
                raise ConfigError(f"the map names no file for the log {name!r}: name one before --map, or in `logs`")
        return files


def load_map(path: Path) -> tuple[LogMap, Tree]:
    """Read and validate a map file.

    Returns
    -------
    LogMap
    Tree
        The settings with the position of each, for messages about the logs.

    Raises
    ------
    ConfigError
        With every mistake at once, each at its file, line and column.
    """
    tree, mistakes = assemble(open_source(path))
    return validated(LogMap, tree, mistakes), tree
