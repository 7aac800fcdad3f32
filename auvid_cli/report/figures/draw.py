"""Requests for figures, and the queue that draws them in other processes."""

from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from concurrent.futures import Future, as_completed, wait
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

import numpy as np

from auvid_cli.arrays import Array, release_memory
from auvid_cli.config.enums import FigureFormat
from auvid_cli.data.dataset import Dataset, SensorRecord, TruthRecord
from auvid_cli.data.estimate import Estimate, EstimateHistory
from auvid_cli.data.innovations import Innovations
from auvid_cli.report.figures import workers
from auvid_cli.report.figures.workers import LONG_DATA, Submit, load_matplotlib, save
from auvid_cli.vehicle.parameters import MOTION, MOTION_AND_DEPTH, MOTION_AND_DEPTH_SYMBOLS, SENSORS, Quantity, state_of

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

    from auvid_cli.campaign.summary import CampaignSummary

    # These load the compiled core, which takes a second and is announced elsewhere.
    from auvid_cli.design.mission import Band
    from auvid_cli.design.search import Design
    from auvid_cli.evaluation.evaluate import Evaluation
    from auvid_cli.evaluation.results import FreeRun, Identifiability
    from auvid_cli.inspection.inspection import Inspection
    from auvid_cli.report.plot_data import CoefficientPlots
    from auvid_cli.validation.results import Prediction, Validation

_MAX_SAMPLES = 100_000  # samples of one sensor, as many as any figure can show


class PathRequest(NamedTuple):
    """The true path and dead reckoning from the estimated motion."""

    truth: TruthRecord | None
    motions: list[EstimateHistory]


class MotionErrorRequest(NamedTuple):
    """Errors of the estimated motion."""

    truth: TruthRecord
    motions: list[EstimateHistory]


class EstimateRequest(NamedTuple):
    """Estimates of the coefficients over time."""

    plots: "CoefficientPlots"


class ConvergenceRequest(NamedTuple):
    """Distances of the coefficients from their true or final values."""

    plots: "CoefficientPlots"


class InnovationRequest(NamedTuple):
    """Innovations by filter and sensor."""

    innovations: dict[str, dict[str, Innovations]]


class FreeRunRequest(NamedTuple):
    """Measurements minus the free runs of all filters."""

    sensors: dict[str, SensorRecord]
    runs: "dict[str, FreeRun]"


class MotionRequest(NamedTuple):
    """Measured motion and the free runs of a model."""

    quantities: Sequence[Quantity]
    sensors: dict[str, SensorRecord]
    runs: "dict[str, FreeRun]"


class HorizonRequest(NamedTuple):
    """Errors of predictions over the horizon."""

    filter: str
    predictions: "Sequence[Prediction]"


class BoundsRequest(NamedTuple):
    """Cramér-Rao bounds of the coefficients."""

    identifiability: "Identifiability"


class CorrelationRequest(NamedTuple):
    """Correlations of the errors at the bounds."""

    identifiability: "Identifiability"


class TimelineRequest(NamedTuple):
    """An inspected dataset."""

    sensors: dict[str, SensorRecord]
    inspection: "Inspection"


class MissionRequest(NamedTuple):
    """A designed run; see `auvid_cli.report.figures.timeline.mission_figure`."""

    time: Array
    inputs: Array
    band: "Band"
    symbols: tuple[str, ...]
    percents: dict[str, Array]


class SpreadRequest(NamedTuple):
    """Errors of all runs of a campaign."""

    runs: "pd.DataFrame"
    columns: list[str]
    filters: dict[str, str]


class MapRequest(NamedTuple):
    """Errors of a campaign over two settings."""

    table: "pd.DataFrame"
    columns: list[str]
    filters: dict[str, str]


FigureRequest: TypeAlias = (
    PathRequest
    | MotionErrorRequest
    | EstimateRequest
    | ConvergenceRequest
    | InnovationRequest
    | FreeRunRequest
    | MotionRequest
    | HorizonRequest
    | BoundsRequest
    | CorrelationRequest
    | TimelineRequest
    | MissionRequest
    | SpreadRequest
    | MapRequest
)


class FigureQueue:
    """Figures of a results folder, drawn as soon as their data exist.

    Parameters
    ----------
    folder : pathlib.Path
        Created if it is missing.
    submit : callable
        As `Executor.submit`. A request contains only the data that its figure needs, because it is sent to another
        process.
    formats : collection of FigureFormat
        PNG has 150 dots per inch.
    duration : float
        Duration of the data, s. If it is long, `add_...` waits for each figure, to save memory.
    """

    def __init__(self, folder: Path, submit: Submit, formats: Collection[FigureFormat], duration: float = 0.0) -> None:
        self._folder = folder
        self._submit = submit
        self._formats = tuple(formats)
        self._duration = duration
        self._drawn: dict[str, Future[list[Path]]] = {}

    def add_estimates(self, dataset: Dataset, estimates: Sequence[Estimate]) -> None:
        """Draw the figures of all filters, those with many panels first; without a filter only the true path."""
        # Imported here because `plot_data` loads the compiled core.
        from auvid_cli.report import plot_data

        innovations = {estimate.filter: estimate.innovations for estimate in estimates if estimate.innovations}
        if innovations:
            self._add("innovations", InnovationRequest(innovations))
        known = dict.fromkeys(c.symbol for estimate in estimates for c in estimate.coefficient_set)
        state = {symbol for estimate in estimates for symbol in estimate.state}
        if symbols := [symbol for symbol in known if symbol in state]:
            true = dataset.truth.coefficients_of(symbols) if dataset.truth is not None else {}
            courses = [estimate.history(symbols) for estimate in estimates]
            self._add("estimates", EstimateRequest(plot_data.estimate_plots(symbols, courses, true)))
            self._add("convergence", ConvergenceRequest(plot_data.convergence_plots(symbols, courses, true)))
        motions = [estimate.history(MOTION_AND_DEPTH_SYMBOLS) for estimate in estimates]
        truth = None if dataset.truth is None else _at_times(dataset.truth, motions)
        if truth is not None or estimates:
            self._add("path", PathRequest(truth, motions))
        if truth is not None and estimates:
            self._add("motion_errors", MotionErrorRequest(truth, motions))

    def add_free_runs(self, dataset: Dataset, evaluation: "Evaluation") -> None:
        """Draw measurements minus free runs, if any sensor measures the motion."""
        sensors = _records_of(MOTION_AND_DEPTH, dataset.sensors)
        if evaluation.free_runs and sensors:
            self._add("free_runs", FreeRunRequest(sensors, evaluation.free_runs))

    def add_identifiability(self, identifiability: "Identifiability") -> None:
        """Draw the bounds of the coefficients and the correlations of their errors."""
        self._add("identifiability_bounds", BoundsRequest(identifiability))
        self._add("identifiability_correlation", CorrelationRequest(identifiability))

    def add_validation(self, validation: "Validation") -> None:
        """Draw the predictions of a model on other data: the free run of the longest segment, and errors by horizon."""
        records = _with_yaw_rate(validation.shown.sensors)
        for name, quantities in (("velocities", MOTION[:6]), ("attitude", validation.run.quantities[6:])):
            sensors = _records_of(quantities, records)
            self._add(f"validation_{name}", MotionRequest(quantities, sensors, {validation.filter: validation.run}))
        self._add("validation_horizons", HorizonRequest(validation.filter, validation.predictions))

    def add_timeline(self, dataset: Dataset, inspection: "Inspection") -> None:
        """Draw the recorded data and mark their faults."""
        sensors = {name: _thinned(record) for name, record in dataset.sensors.items()}
        self._add("timeline", TimelineRequest(sensors, inspection))

    def add_mission(self, design: "Design", band: "Band") -> None:
        """Draw a designed run next to the spiral that it was compared with."""
        shown = dict.fromkeys((design.chosen, "spiral"))
        percents = {name: design.trials[name].percent() for name in shown}
        self._add("mission", MissionRequest(design.truth.time, design.truth.inputs, band, design.symbols, percents))

    def add_campaign(self, summary: "CampaignSummary", filters: dict[str, str]) -> None:
        """Draw the spread of the errors of each filter variant, and a map if two settings vary."""
        self._add("spread", SpreadRequest(summary.runs, summary.columns, filters))
        if len(summary.columns) > 1:
            self._add("map", MapRequest(summary.filters, summary.columns, filters))

    def finish(self, progress: Callable[[int, int], None] = lambda done, total: None) -> list[Path]:
        """Wait until all are drawn.

        Parameters
        ----------
        progress : callable
            Called with the number of finished figures and the number of all.

        Raises
        ------
        FileError
            If a file cannot be written; an existing file then stays as it was.
        """
        for done, _ in enumerate(as_completed(self._drawn.values()), 1):
            progress(done, len(self._drawn))
        return [path for future in self._drawn.values() for path in future.result()]

    def _add(self, name: str, request: FigureRequest) -> None:
        self._drawn[name] = self._submit(draw_and_save, request, self._folder, name, self._formats)
        if self._duration > LONG_DATA:
            wait([self._drawn[name]])


@contextmanager
def drawing(folder: Path, formats: Collection[FigureFormat] | None, duration: float = 0.0) -> Iterator[FigureQueue]:
    """Yield the figure queue of a results folder, with processes that draw; the default format is PNG.

    `duration` is that of the data, see `FigureQueue`.
    """
    with workers.figure_workers(duration) as submit:
        yield FigureQueue(folder / "figures", submit, formats or (FigureFormat.PNG,), duration)


def _records_of(quantities: Sequence[Quantity], sensors: dict[str, SensorRecord]) -> dict[str, SensorRecord]:
    """Return the sensors that measure any of the quantities; long records are thinned."""
    symbols = {quantity.symbol for quantity in quantities}
    return {
        name: _thinned(record)
        for name, record in sensors.items()
        if symbols & {state_of(component) for component in SENSORS[name]}
    }


def _with_yaw_rate(sensors: dict[str, SensorRecord]) -> dict[str, SensorRecord]:
    """Return the sensors; without a gyroscope also the yaw rate from the attitude, which the tables judge as well."""
    # This module loads the compiled core.
    from auvid_cli.validation.motion_prediction import measured_signals

    rate = measured_signals(sensors).get("r")
    if "gyroscope" in sensors or rate is None:
        return sensors
    values = np.column_stack([np.full((rate.time.size, 2), np.nan), rate.values])
    return sensors | {"gyroscope": SensorRecord(rate.time, values, np.full(3, rate.deviation))}


def _at_times(truth: TruthRecord, motions: Iterable[EstimateHistory]) -> TruthRecord:
    """Return about `_MAX_SAMPLES` rows of the truth, and those before and after each time of the motions."""
    n = truth.time.size
    rows = [np.arange(0, n, 1 + n // _MAX_SAMPLES)]
    for motion in motions:
        after = np.searchsorted(truth.time, motion.time)
        rows += [np.maximum(after - 1, 0), np.minimum(after, n - 1)]
    some = np.unique(np.concatenate(rows))
    return TruthRecord(truth.time[some], truth.motion[some], truth.position[some], truth.coefficients)


def _thinned(record: SensorRecord) -> SensorRecord:
    """Return about `_MAX_SAMPLES` rows, and as many where each component is known, because these rows may differ."""
    every = 1 + record.time.size // _MAX_SAMPLES
    of_components = [np.flatnonzero(known)[::every].copy() for known in np.isfinite(record.values).T]
    rows = np.unique(np.concatenate([np.arange(0, record.time.size, every), *of_components]))
    thinned = SensorRecord(record.time[rows], record.values[rows], record.standard_deviation)
    release_memory()
    return thinned


def draw_and_save(request: FigureRequest, folder: Path, name: str, formats: Collection[FigureFormat]) -> list[Path]:
    """Draw the figure of a request and write it; called in a process that may load matplotlib."""
    load_matplotlib()
    return save(_draw_figure(request), folder, name, formats)


def _draw_figure(request: FigureRequest) -> "Figure":
    """Return the figure of a request."""
    from auvid_cli.report.figures import coefficients, motion, timeline, validation

    match request:
        case PathRequest(truth, motions):
            return motion.path_figure(truth, motions)
        case MotionErrorRequest(truth, motions):
            return motion.motion_error_figure(truth, motions)
        case EstimateRequest(plots):
            return coefficients.estimate_figure(plots)
        case ConvergenceRequest(plots):
            return coefficients.convergence_figure(plots)
        case InnovationRequest(innovations):
            return validation.innovation_figure(innovations)
        case FreeRunRequest(sensors, runs):
            return validation.free_run_figure(sensors, runs)
        case MotionRequest(quantities, sensors, runs):
            return motion.motion_figure(quantities, sensors, runs)
        case HorizonRequest(filter_name, predictions):
            return validation.horizon_figure(filter_name, predictions)
        case BoundsRequest(identifiability):
            return coefficients.bounds_figure(identifiability)
        case CorrelationRequest(identifiability):
            return coefficients.correlation_figure(identifiability)
        case TimelineRequest(sensors, inspection):
            return timeline.timeline_figure(sensors, inspection)
        case MissionRequest(time, inputs, band, symbols, percents):
            return timeline.mission_figure(time, inputs, band, symbols, percents)
        case SpreadRequest(runs, columns, filters):
            return coefficients.spread_figure(runs, columns, filters)
        case MapRequest(table, columns, filters):
            return coefficients.map_figure(table, columns, filters)
