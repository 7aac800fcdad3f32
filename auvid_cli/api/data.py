"""Steps that need no compiled code: import of logs, inspection, comparison of results."""

import os
from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from pathlib import Path

from auvid_cli.api import Destination, Progress, write_and_draw
from auvid_cli.api.files import RecordedData, checked, read_dataset, results_folder
from auvid_cli.config.enums import shipped_files, shipped_part
from auvid_cli.config.log_map import load_map
from auvid_cli.data.checks import DEVIATIONS, Comparison, Tolerance, compare_tables, read_result_tables
from auvid_cli.data.dataset import Dataset, cut
from auvid_cli.data.files import check_no_overlap, dataset_in, folder_of_run, locked, write_text
from auvid_cli.data.results import other_run, put_dataset
from auvid_cli.errors import ConfigError, FileError
from auvid_cli.inspection.inspect import inspect_dataset
from auvid_cli.inspection.inspection import Inspection
from auvid_cli.logs.convert import Conversion, dataset_from_logs, recorded_files
from auvid_cli.logs.formats.open_log import open_log
from auvid_cli.logs.suggest.suggest import MAX_TEXT, suggest


class MappedLogs:
    """Logs and their map; see `import_logs`."""

    def __init__(self, map_file: Path, logs: Sequence[str]) -> None:
        self.settings, self._tree = load_map(map_file)
        in_map = {(map_file.parent / file).resolve() for file in self.settings.files_in_map()}
        # The order does not matter if they are the files that the map names.
        given = () if {Path(log).resolve() for log in logs} == in_map else logs
        self._files = self.settings.files(map_file.parent, given)

    def inputs(self) -> list[Path]:
        """Return all files that are read."""
        return [*self._tree.files(), *recorded_files(self._files)]

    def convert(self) -> tuple[Dataset, Conversion]:
        """Return the dataset, and a summary of the conversion."""
        return dataset_from_logs(self.settings, self._tree, self._files)


@checked
def import_logs(map_file: str | Path, *logs: str | Path) -> Dataset:
    """Convert logs (CSV, NumPy, MATLAB, ROS bags, ArduPilot) to a dataset; see docs/how-to/import-logs.md.

    Parameters
    ----------
    map_file : str or pathlib.Path
        YAML file that assigns columns of the logs to signals; ``auvid import --suggest`` writes a first one.
    *logs : str or pathlib.Path
        Files in the order of ``logs`` in the map, or ``NAME=FILE``. Default: the files in the map.

    Returns
    -------
    Dataset
        SI; t = 0 is the first sample. ``experiment.recording`` has its sources and remarks.

    Raises
    ------
    ConfigError
        With all mistakes of the map, and all entries that do not fit the logs.
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


def import_into(
    file: Path | None, logs: MappedLogs, overwrite: bool, progress: Progress
) -> tuple[Path, Dataset, Conversion]:
    """Convert logs to a dataset file; returns its path, the dataset, and a summary of the conversion."""
    path, inputs = file or dataset_in(folder_of_run(logs.settings.name)), logs.inputs()
    check_no_overlap([path], inputs)
    with progress.stage("read the logs"):
        dataset, conversion = logs.convert()
    # Lock results folders only: other folders may hold files of other programs.
    in_results_folder = path == dataset_in(path.parent)
    with progress.stage("write the dataset"), locked(path.parent) if in_results_folder else nullcontext():
        put_dataset(path, dataset, inputs, overwrite, other_run(path, dataset.experiment))
    return path, dataset, conversion


def suggest_map(logs: Sequence[Path], folder: Path, vehicle: Path | None = None, like: str | None = None) -> str:
    """Return a first map of logs, which the user must complete; its paths are relative to `folder`.

    Files named .msg define messages that ROS bags among the logs lack.

    Parameters
    ----------
    logs : sequence of pathlib.Path
    folder : pathlib.Path
    vehicle : pathlib.Path, optional
        Vehicle file. Default: the map asks for size and parameters.
    like : str, optional
        Name of a shipped vehicle, instead of a file.

    Raises
    ------
    ConfigError
        If there is no such vehicle.
    FileError
        If a log is missing or damaged.
    """
    name = None if vehicle is None else os.path.relpath(vehicle, folder)
    if vehicle is not None and not vehicle.is_file():
        raise ConfigError(f"{vehicle}: no such vehicle file; `auvid init` writes one")
    if like is not None:
        name = f"vehicles/{like}.yaml"
        if shipped_part(name) is None:
            shipped = ", ".join(Path(file.name).stem for file in shipped_files("vehicles"))
            raise ConfigError(f"--like {like}: unknown vehicle; expected one of {shipped}")
    definitions = [path for path in logs if path.suffix == ".msg"]
    opened = [open_log(path, None, MAX_TEXT, definitions) for path in logs if path not in definitions]
    return suggest(opened, folder, name)


def suggest_into(
    file: Path | None,
    logs: Sequence[Path],
    progress: Progress,
    vehicle: Path | None = None,
    like: str | None = None,
) -> str:
    """Return a first map of logs, and write it to `file` unless that is None; an existing file is never replaced."""
    if file is not None and file.exists():
        raise FileError(f"{file}: exists already; remove it, or choose another file for the suggested map")
    with progress.stage("read the logs"):
        text = suggest_map(logs, Path() if file is None else file.parent, vehicle, like)
    if file is not None:
        write_text(file, text)
    return text


@checked
def inspect(dataset: Dataset, use: tuple[float, float] | None = None) -> Inspection:
    """Check recorded data before identification: clocks, gaps, spikes, signs, units, excitation.

    Parameters
    ----------
    dataset : Dataset
        Its truth is not used.
    use : tuple of float, optional
        Begin and end, s, of the part to inspect. Default: all.

    Returns
    -------
    Inspection
        ``checks`` are the verdicts; ``to_pandas()`` makes a table of them.

    Raises
    ------
    DataError
        If that part has no data.

    Examples
    --------
    >>> verdicts = auvid.inspect(dataset).to_pandas()
    >>> list(verdicts.columns)
    ['subject', 'check', 'statistic', 'threshold', 'passed', 'advice']
    """
    return inspect_dataset(dataset if use is None else cut(dataset, *use))


def inspect_into(
    place: Destination, path: Path, overrides: Sequence[str]
) -> tuple[Dataset, Inspection, list[Path], Path]:
    """Inspect a dataset file, and write the verdicts into its results folder.

    Only the span of ``identification.use.spans`` is inspected, if the overrides set one. Returns the inspected part of
    the dataset, the verdicts, the written files, and the page.
    """
    from auvid_cli.report.page.pages import inspection_page

    with place.progress.stage("read the dataset"):
        dataset = read_dataset(path, *overrides)
    if overrides:
        spans = dataset.experiment.identification.use.spans
        if len(spans) != 1:
            raise ConfigError(f"--use: {len(spans)} parts given; expected one")
        dataset = cut(dataset, *spans[0])
    with results_folder(place, RecordedData(path, dataset), page="inspection.html") as folder:
        with place.progress.stage("inspect"):
            inspection = inspect_dataset(dataset)
        page = folder / "inspection.html"
        paths = write_and_draw(
            page,
            place,
            {"inspection": inspection.rows()},
            lambda figures: figures.add_timeline(dataset, inspection),
            lambda: inspection_page(dataset, inspection),
        )
        return dataset, inspection, paths, page


def compare_results(
    first: Path, second: Path, relative: float | None, by_column: Mapping[str, float], deviations: float | None
) -> Comparison:
    """Compare the tables of two results folders; the second is the reference.

    Parameters
    ----------
    relative : float or None
        Largest relative difference. None: 0.01, except for estimates, which are compared by `deviations`.
    by_column : mapping of float
        Largest relative difference of single columns.
    deviations : float or None
        Largest difference of an estimate, in standard deviations. None: 0.01.
    """
    tolerance = Tolerance(relative, by_column, DEVIATIONS if deviations is None else deviations)
    names = [Path(os.path.realpath(folder)).name for folder in (first, second)]
    return compare_tables(read_result_tables(first, names[1]), read_result_tables(second, names[0]), tolerance)
