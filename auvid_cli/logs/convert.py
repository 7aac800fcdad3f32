"""From logs and a map to inputs and sensors on one clock, with a report of what was done."""

from collections.abc import Mapping
from typing import NamedTuple

from auvid_cli.config.log_map import LogMap
from auvid_cli.config.tree import Tree
from auvid_cli.data.dataset import InputRecord, SensorRecord
from auvid_cli.logs.columns import ColumnReader
from auvid_cli.logs.formats.log import Log
from auvid_cli.logs.import_report import ImportSummary
from auvid_cli.logs.input_record import read_inputs
from auvid_cli.logs.refusals import Refusals
from auvid_cli.logs.requests import find_requests
from auvid_cli.logs.sensor_records import read_sensors


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
    refusals = Refusals(tree)
    requests = find_requests(settings, tree, logs, refusals)
    refusals.stop_if_any()
    columns = ColumnReader(logs, requests.values())
    sensors = read_sensors(settings, requests, columns, refusals)
    inputs, summaries, remarks = read_inputs(settings, requests, columns, sensors, refusals)
    return Conversion(inputs, sensors.records, sensors.origin, (*sensors.summaries, *summaries), remarks)
