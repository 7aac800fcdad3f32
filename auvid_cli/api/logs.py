"""Datasets from a vehicle's own logs."""

from collections.abc import Sequence
from pathlib import Path

from auvid_cli.api.argument_types import typed
from auvid_cli.config.log_map import load_map
from auvid_cli.data.dataset import Dataset
from auvid_cli.logs.convert import Conversion
from auvid_cli.logs.dataset import dataset_from_logs, recorded_files
from auvid_cli.logs.formats.open_log import open_log
from auvid_cli.logs.suggest.suggest import suggest


class MappedLogs:
    """Logs with the map by which they are to be converted; see `import_logs`.

    Parameters
    ----------
    map_file : pathlib.Path
    logs : sequence of str

    Attributes
    ----------
    settings : LogMap

    Raises
    ------
    ConfigError
        With all mistakes of the map.
    """

    def __init__(self, map_file: Path, logs: Sequence[str]) -> None:
        self.settings, self._tree = load_map(map_file)
        self._files = self.settings.files(map_file.parent, logs)

    def inputs(self) -> list[Path]:
        """Return all files that are read."""
        return [*self._tree.files(), *recorded_files(self._files)]

    def convert(self) -> tuple[Dataset, Conversion]:
        """Return the dataset, and a summary of what was done.

        Raises
        ------
        ConfigError
            With all places of the map that do not fit the logs.
        FileError
            If a log is missing or damaged.
        """
        return dataset_from_logs(self.settings, self._tree, self._files)


@typed
def import_logs(map_file: str | Path, *logs: str | Path) -> Dataset:
    """Convert CSV, NumPy or MATLAB files, ROS bags or ArduPilot logs by a map; see docs/how-to/import-logs.md.

    Parameters
    ----------
    map_file : str or pathlib.Path
        YAML file that says what is what in the logs; ``auvid import --suggest`` writes a first one.
    *logs : str or pathlib.Path
        Files in the order of the map's ``logs``, or ``NAME=FILE``. Default: those that the map names.

    Returns
    -------
    Dataset
        SI, its time from the first sample on; ``experiment.recording`` says where it comes from and what was
        remarkable.

    Raises
    ------
    ConfigError
        With all mistakes of the map, and all places where it does not fit the logs.
    FileError
        If a log is missing or damaged.

    Examples
    --------
    >>> dataset = auvid.import_logs("map.yaml")
    >>> dataset.experiment.recording.files[0].name
    'log.csv'
    """
    dataset, _ = MappedLogs(Path(map_file), [str(log) for log in logs]).convert()
    return dataset


def suggest_map(logs: Sequence[Path], folder: Path) -> str:
    """Suggest a map of logs, as the text of a file in a folder, to be looked at and filled in.

    Raises
    ------
    FileError
        If a log is missing or damaged.
    """
    return suggest([open_log(log) for log in logs], folder)
