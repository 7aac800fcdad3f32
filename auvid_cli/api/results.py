"""Complete steps in a results folder: run, report, check, identifiability, validation."""

from collections.abc import Collection, Sequence
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import NamedTuple

from auvid_cli.api import Destination, Progress, write_and_draw
from auvid_cli.api.evaluation import Evaluator, check, identifiability, predict, prepare
from auvid_cli.api.files import (
    DataSource,
    RecordedData,
    SimulatedData,
    checked,
    read_dataset,
    read_estimate,
    results_folder,
)
from auvid_cli.api.identification import estimate_delays_and_noise, identify_into
from auvid_cli.api.simulation import simulate_into
from auvid_cli.arrays import trim_heap
from auvid_cli.config.enums import FigureFormat, FilterName, named
from auvid_cli.config.experiment import Experiment
from auvid_cli.data.checks import Checks
from auvid_cli.data.dataset import Dataset
from auvid_cli.data.estimate import Estimate
from auvid_cli.data.estimate_file import read_reference
from auvid_cli.data.files import (
    check_no_overlap,
    dataset_in,
    locked,
    page_in,
    products,
    remove_former,
    tables_and_figures,
)
from auvid_cli.data.hdf5 import scan
from auvid_cli.data.netcdf import digest
from auvid_cli.data.results import read_results, refuse_other_page
from auvid_cli.evaluation.evaluate import Evaluation
from auvid_cli.evaluation.results import Identifiability
from auvid_cli.report.figures.draw import FigureQueue, drawing
from auvid_cli.report.layout import write_tables
from auvid_cli.report.page.pages import identifiability_page, run_page, validation_page
from auvid_cli.report.page.render import write_page
from auvid_cli.report.text_tables import write_csv_tables
from auvid_cli.validation.data_leakage import unseen_segments
from auvid_cli.validation.results import Validation

_BOUNDS_PAGE = "identifiability.html"


class RunResult(NamedTuple):
    """Contents of a results folder; `estimates` are in the order of the filters, `files` are tables and figures."""

    dataset: Dataset
    estimates: list[Estimate]
    evaluation: Evaluation
    checks: Checks
    folder: Path
    files: list[Path]
    page: Path


@checked
def run(
    experiment: Experiment,
    output: str | Path | None = None,
    filters: Sequence[str] | None = None,
    *,
    overwrite: bool = False,
    figure_formats: Sequence[str] = ("png",),
    inputs: Sequence[Path] = (),
    progress: Progress | None = None,
) -> RunResult:
    """Simulate an experiment, run its filters, evaluate them, and write everything into a results folder.

    Parameters
    ----------
    experiment : Experiment
        See `load_experiment`.
    output : str or pathlib.Path, optional
        Results folder. Default: ``results/NAME``.
    filters : sequence of str, optional
        Such as ``["ckf", "tukf"]``. Default: ``identification.filters``. The smoother runs as well, because it judges
        the others.
    overwrite : bool, default False
        Whether results of other settings in the folder are replaced.
    figure_formats : sequence of str, default ("png",)
        ``"png"``, ``"pdf"`` or ``"svg"``; at least one.
    inputs : sequence of pathlib.Path, optional
        Files that must not be overwritten, such as the settings files.
    progress : Progress, optional
        Its methods are called during the work, see `auvid_cli.api.Progress`. Default: silent.

    Returns
    -------
    RunResult
        ``dataset``, ``estimates``, ``evaluation``, ``checks``; the ``folder``, its ``page``, and ``files``, the tables
        and figures.

    Raises
    ------
    ConfigError
        If a filter or format is unknown, or the settings are invalid.
    SimulationError
        If the vehicle leaves the range in which the model is valid.
    DataError
        If no sensor is usable.
    FileError
        If the folder has results of other settings and `overwrite` is false, or writing fails.

    Examples
    --------
    >>> experiment = auvid.load_experiment("spiral", "manoeuvre.duration=20 s")
    >>> result = auvid.run(experiment, "results/short", ["ckf"])
    >>> [estimate.filter for estimate in result.estimates], result.page.name
    (['ckf', 'smoother'], 'report.html')
    """
    settings, progress = experiment.identification, progress or Progress()
    names = [named(FilterName, name, "filter") for name in filters or settings.default_filters()]
    formats = [named(FigureFormat, name, "format of a figure") for name in figure_formats]
    chosen = settings.with_judge(names)
    settings.check_filters(chosen)
    source = SimulatedData(experiment, inputs)
    folder = source.folder if output is None else Path(output)
    with locked(folder):
        refuse_other_page(page_in(folder))
        check_no_overlap(products(folder), inputs)
        with drawing(folder, formats, experiment.manoeuvre.duration) as figures:
            dataset = simulate_into(folder, source, overwrite, progress, chosen)
            prepared = estimate_delays_and_noise(prepare(dataset), progress)
            evaluator = Evaluator(prepared)
            # Compute the bounds of the first estimates while the slowest filter is still running.
            estimates = identify_into(folder, prepared, chosen, overwrite, progress, evaluator.find_bounds)
            return _report(folder, evaluator, estimates, figures, progress)


def _existing(folder: Path) -> AbstractContextManager[None]:
    """Lock a results folder; one that is missing is not created, and reading its dataset fails."""
    return locked(folder) if folder.is_dir() else nullcontext()


def report(folder: Path, figure_formats: Collection[FigureFormat], progress: Progress) -> RunResult:
    """Evaluate a results folder, and write its tables, figures and page."""
    with _existing(folder):
        refuse_other_page(page_in(folder))
        dataset, estimates = read_results(folder)
        with drawing(folder, figure_formats, dataset.duration) as figures:
            return _report(folder, Evaluator(prepare(dataset)), estimates, figures, progress)


def _report(
    folder: Path, evaluator: Evaluator, estimates: list[Estimate], figures: FigureQueue, progress: Progress
) -> RunResult:
    dataset = evaluator.dataset
    figures.add_estimates(dataset, estimates)
    with progress.stage("evaluate"):
        evaluation = evaluator.evaluate(estimates)
    trim_heap()
    figures.add_free_runs(dataset, evaluation)
    with progress.stage("check"):
        checks = evaluator.check(estimates)
    files = write_tables(evaluation, folder / "tables")
    files += write_csv_tables({"checks": checks.rows()}, folder / "tables")
    with progress.stage("page"):
        # The page is made while other processes draw.
        page = write_page(run_page(dataset, estimates, evaluation, checks), page_in(folder))
    with progress.bars("figures") as (advance,):
        files += figures.finish(advance)
    remove_former(folder, files)
    return RunResult(dataset, estimates, evaluation, checks, folder, files, page)


def check_into(folder: Path, progress: Progress) -> tuple[Checks, Path]:
    """Check every estimate of a results folder; returns the verdicts and the written table."""
    with _existing(folder):
        dataset, estimates = read_results(folder)
        with progress.stage("check"):
            checks = check(dataset, *estimates)
        (file,) = write_csv_tables({"checks": checks.rows()}, folder / "tables")
        return checks, file


class BoundsResult(NamedTuple):
    """Bounds of a dataset, the source of the coefficients that they hold at (`where`), and the written files."""

    dataset: Dataset
    bounds: Identifiability
    where: str
    files: list[Path]
    page: Path


def identifiability_into(place: Destination, source: DataSource, at: Path | None) -> BoundsResult:
    """Compute the best possible accuracy of each coefficient, and write it into a results folder.

    Parameters
    ----------
    source : DataSource
        An experiment is simulated into the folder.
    at : pathlib.Path or None
        Estimate file whose coefficients the bounds hold at. None: true coefficients, or else those of the vehicle file.
    """
    earlier = [] if at is None else [at]
    if isinstance(source, RecordedData):
        with results_folder(place, source, earlier, page=_BOUNDS_PAGE) as folder:
            return _bounds_into(folder / _BOUNDS_PAGE, place, source.dataset, at)
    folder = place.folder or source.folder
    with locked(folder):
        refuse_other_page(folder / _BOUNDS_PAGE)
        all_files = source._replace(files=[*source.files, *earlier])
        dataset = simulate_into(folder, all_files, place.overwrite, place.progress)
        check_no_overlap(tables_and_figures(folder), all_files.files)
        return _bounds_into(folder / _BOUNDS_PAGE, place, dataset, at)


def _bounds_into(page: Path, place: Destination, dataset: Dataset, at: Path | None) -> BoundsResult:
    coefficients, where = _coefficients(dataset, at)
    with place.progress.stage("sensitivities"):
        bounds = identifiability(dataset, coefficients)
    paths = write_and_draw(
        page,
        place,
        bounds.tables(),
        lambda figures: figures.add_identifiability(bounds),
        lambda: identifiability_page(dataset, bounds, where),
    )
    return BoundsResult(dataset, bounds, where, paths, page)


def _coefficients(dataset: Dataset, estimate: Path | None) -> tuple[dict[str, float] | None, str]:
    """Return the coefficients of an estimate file, or None, and a description of their source."""
    if estimate is None:
        return None, "the true coefficients" if dataset.truth is not None else "the coefficients of the vehicle file"
    earlier, where = read_estimate(estimate), f"the coefficients of {estimate}"
    vehicle = earlier.experiment.vehicle.name
    if vehicle != dataset.experiment.vehicle.name:
        where += f" (of another vehicle: {vehicle})"
    return earlier.final_coefficients(), where


def validate_into(
    place: Destination, estimate_file: Path, dataset_files: Sequence[Path], overrides: Sequence[str], anew: bool
) -> tuple[Validation, list[Path], Path]:
    """Validate an estimate with other datasets, and write the results into a folder (default: of the first dataset).

    Returns the validation, the written files, and the page.
    """
    scan([estimate_file, *dataset_files])
    estimate = read_estimate(estimate_file)
    datasets = [read_dataset(path, *overrides) for path in dataset_files]
    with place.progress.stage("compare with the data of the estimate"):
        training = _training_dataset(estimate_file, estimate)
        segments = [part for dataset in datasets for part in unseen_segments(dataset, estimate, training)]
    first = RecordedData(dataset_files[0], datasets[0])
    with results_folder(place, first, [estimate_file, *dataset_files], page="validation.html") as folder:
        page = folder / "validation.html"
        with place.progress.stage("predict"):
            reference = read_reference(estimate_file, estimate)
            validation = predict(segments, estimate, training, anew=anew, reference=reference)
        paths = write_and_draw(
            page,
            place,
            validation.tables(),
            lambda figures: figures.add_validation(validation),
            lambda: validation_page(validation),
        )
        return validation, paths, page


def _training_dataset(path: Path, estimate: Estimate) -> Dataset | None:
    """Return the dataset of an estimate in a results folder, or None if it is missing or was changed."""
    dataset = dataset_in(path.resolve().parents[1])
    if dataset.is_file() and digest(dataset) == estimate.dataset_sha256:
        return read_dataset(dataset)
    return None
