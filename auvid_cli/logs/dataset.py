"""From a map and the files that it names to a dataset, with where it comes from."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from auvid_cli.config.experiment import ImportedRun, RecordedFile, Recording
from auvid_cli.config.log_map import LogMap
from auvid_cli.config.tree import Tree
from auvid_cli.data.dataset import Dataset
from auvid_cli.data.netcdf import digest
from auvid_cli.logs.convert import Conversion, convert
from auvid_cli.logs.formats.joined import JoinedLog
from auvid_cli.logs.formats.log import Log
from auvid_cli.logs.formats.open_log import open_log
from auvid_cli.logs.formats.text_layout import TextLayout

# Of each log by its name, all that continue each other.
LogFiles = Mapping[str, Sequence[Path]]


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
