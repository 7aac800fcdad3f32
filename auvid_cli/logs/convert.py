"""Convert logs to a dataset by a map."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from auvid_cli.config.experiment import ImportedRun, RecordedFile, Recording
from auvid_cli.config.log_map import LogMap
from auvid_cli.config.source_positions import Tree
from auvid_cli.data.dataset import Dataset, InputRecord, SensorRecord
from auvid_cli.data.netcdf import digest
from auvid_cli.logs.formats.log import JoinedLog, Log
from auvid_cli.logs.formats.open_log import open_log
from auvid_cli.logs.formats.text_layout import TextLayout
from auvid_cli.logs.inputs import read_inputs
from auvid_cli.logs.measurements import ImportSummary
from auvid_cli.logs.requests import ColumnReader, MapErrors, find_requests
from auvid_cli.logs.sensor_records import read_sensors

# Of each log by its name, all that continue each other.
LogFiles = Mapping[str, Sequence[Path]]


class Conversion(NamedTuple):
    """What a map makes of logs.

    Attributes
    ----------
    inputs : InputRecord
    sensors : dict of SensorRecord
    origin : float
        s, by the log's clock, of t = 0: the first sample of the earliest sensor.
    summaries : tuple of ImportSummary
    remarks : tuple of str
    """

    inputs: InputRecord
    sensors: dict[str, SensorRecord]
    origin: float
    summaries: tuple[ImportSummary, ...]
    remarks: tuple[str, ...]


def convert(settings: LogMap, tree: Tree, logs: Mapping[str, Log]) -> Conversion:
    """Convert logs.

    Parameters
    ----------
    settings : LogMap
    tree : Tree
        The map as it was read: where mistakes are.
    logs : mapping of str to Log
        Opened logs by the map's names for them.

    Raises
    ------
    ConfigError
        With all places of the map that do not fit the logs.
    FileError
        If a log is damaged.
    """
    refusals = MapErrors(tree)
    requests = find_requests(settings, tree, logs, refusals)
    refusals.stop_if_any()
    columns = ColumnReader(logs, requests.values())
    sensors = read_sensors(settings, requests, columns, refusals)
    inputs, summaries, remarks = read_inputs(settings, requests, columns, sensors, refusals)
    return Conversion(inputs, sensors.records, sensors.origin, (*sensors.summaries, *summaries), remarks)


def dataset_from_logs(settings: LogMap, tree: Tree, files: LogFiles) -> tuple[Dataset, Conversion]:
    """Convert log files, and name them in the settings of the dataset.

    Parameters
    ----------
    settings : LogMap
    tree : Tree
        The map as it was read.
    files : mapping of sequences of pathlib.Path
        See `LogMap.files`.

    Returns
    -------
    Dataset
    Conversion
        The report of what was done.

    Raises
    ------
    ConfigError
        With all places of the map that do not fit the logs.
    FileError
        If a log cannot be read.
    """
    logs = {name: _opened(paths, _layout(settings, name)) for name, paths in files.items()}
    conversion = convert(settings, tree, logs)
    recorded = tuple(RecordedFile(name=file.name, sha256=digest(file)) for file in recorded_files(files))
    remarks = {summary.name: summary.remarks for summary in conversion.summaries if summary.remarks}
    run = ImportedRun(
        name=settings.name,
        vehicle=settings.vehicle,
        identification=settings.identification,
        recording=Recording(files=recorded, map=tree.at.source.text, origin=conversion.origin, remarks=remarks),
    )
    return Dataset(conversion.inputs, conversion.sensors, run), conversion


def recorded_files(files: LogFiles) -> list[Path]:
    """Return all files of some logs; a bag may be a folder of them."""
    return [part for paths in files.values() for path in paths for part in _parts(path)]


def _parts(log: Path) -> list[Path]:
    return [part for part in sorted(log.rglob("*")) if part.is_file()] if log.is_dir() else [log]


def _opened(paths: Sequence[Path], layout: TextLayout) -> Log:
    logs = [open_log(path, layout) for path in paths]
    return logs[0] if len(logs) == 1 else JoinedLog(logs)


def _layout(settings: LogMap, name: str) -> TextLayout:
    log = settings.logs[name]
    return TextLayout(log.delimiter, log.header_row, log.decimal, log.missing, log.names)
