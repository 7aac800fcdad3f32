"""Datasets from a vehicle's own logs."""

from pathlib import Path

from auvid_cli.config.log_map import load_map
from auvid_cli.data.dataset import Dataset
from auvid_cli.logs.dataset import dataset_from_logs


def import_logs(map_file: str | Path, *logs: str | Path) -> Dataset:
    """Convert CSV, NumPy or MATLAB files, ROS bags or ArduPilot logs by a map; see ``auvid import`` in the guide.

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
    settings, tree = load_map(Path(map_file))
    files = settings.files(Path(map_file).parent, [str(log) for log in logs])
    dataset, _ = dataset_from_logs(settings, tree, files)
    return dataset
