"""Settings by which a vehicle's logs become a dataset."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, model_validator

from auvid_cli.config.assemble import assemble
from auvid_cli.config.experiment import with_lag_of_vehicle
from auvid_cli.config.identification import Identification, IdentificationOfVehicle
from auvid_cli.config.load import open_source, validated
from auvid_cli.config.log_columns import TimeSource
from auvid_cli.config.log_inputs import InputsMap
from auvid_cli.config.log_sensors import SensorMaps
from auvid_cli.config.settings import Settings
from auvid_cli.config.spans import Spans
from auvid_cli.config.tree import Tree
from auvid_cli.config.vehicle import VehicleSettings
from auvid_cli.errors import ConfigError


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
        return with_lag_of_vehicle(data)

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
