"""Which figures a run gets."""

from collections.abc import Callable, Collection, Iterator, Sequence
from concurrent.futures import Future, as_completed
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from auvid_cli.config.enums import FigureFormat
from auvid_cli.data.dataset import Dataset, SensorRecord
from auvid_cli.data.estimate import Estimate
from auvid_cli.report.figures import workers
from auvid_cli.report.figures.workers import Submit, draw_and_save
from auvid_cli.vehicle.parameters import MOTION, MOTION_AND_DEPTH, MOTION_SYMBOLS, SENSORS, Quantity, state_of

if TYPE_CHECKING:
    from auvid_cli.campaign.summary import CampaignSummary

    # They bring the compiled core along, which is loaded elsewhere, and said to be.
    from auvid_cli.design.mission import Band
    from auvid_cli.design.search import Design
    from auvid_cli.evaluation.assessment import Identifiability
    from auvid_cli.evaluation.evaluate import Evaluation
    from auvid_cli.inspection.inspection import Inspection
    from auvid_cli.validation.results import Validation

# Of one sensor, as many as any figure can show.
_MOST_SAMPLES = 100_000


class FigureQueue:
    """Figures of a results folder, drawn as soon as what they show is there.

    Parameters
    ----------
    folder : pathlib.Path
        Made if it is missing.
    submit : callable
        As `Executor.submit`, to those who draw. They are handed no more data than a figure needs: it may travel to
        another process.
    formats : collection of FigureFormat
        As which each is written; PNG has 150 dots an inch.
    """

    def __init__(self, folder: Path, submit: Submit, formats: Collection[FigureFormat]) -> None:
        self._folder = folder
        self._submit = submit
        self._formats = tuple(formats)
        self._drawn: dict[str, Future[list[Path]]] = {}

    def add_estimates(self, dataset: Dataset, estimates: Sequence[Estimate]) -> None:
        """Draw all filters together, those figures of many panels first; the path also where there is no filter."""
        innovations = {estimate.filter: estimate.innovations for estimate in estimates if estimate.innovations}
        if innovations:
            self._add("innovations", "innovations", innovations)
        known = dict.fromkeys(c.symbol for estimate in estimates for c in estimate.coefficient_set)
        state = {symbol for estimate in estimates for symbol in estimate.state}
        if symbols := [symbol for symbol in known if symbol in state]:
            true = dataset.truth.coefficients_of(symbols) if dataset.truth is not None else {}
            courses = [estimate.history(symbols) for estimate in estimates]
            self._add("estimates", "estimates", symbols, courses, true)
            self._add("convergence", "convergence", symbols, courses, true)
        motions = [estimate.history(MOTION_SYMBOLS) for estimate in estimates]
        if dataset.truth is not None or estimates:
            self._add("path", "path", dataset.truth, motions)
        if dataset.truth is not None and estimates:
            self._add("motion_errors", "motion_errors", dataset.truth, motions)

    def add_free_runs(self, dataset: Dataset, evaluation: "Evaluation") -> None:
        """Draw what free runs leave of the measurements, where there are any of the motion."""
        sensors = _records_of(MOTION_AND_DEPTH, dataset.sensors)
        if evaluation.free_runs and sensors:
            self._add("free_runs", "free_runs", sensors, evaluation.free_runs)

    def add_identifiability(self, identifiability: "Identifiability") -> None:
        """Draw what the data can say before any filter runs."""
        self._add("identifiability_bounds", "bounds", identifiability)
        self._add("identifiability_correlation", "correlation", identifiability)

    def add_validation(self, validation: "Validation") -> None:
        """Draw what a model predicts of data that it has not seen; of several segments the free run of the longest."""
        for name, quantities in (("velocities", MOTION[:6]), ("attitude", validation.run.quantities[6:])):
            sensors = _records_of(quantities, validation.shown.sensors)
            self._add(f"validation_{name}", "motion", quantities, sensors, {validation.filter: validation.run})
        self._add("validation_horizons", "horizons", validation.filter, validation.predictions)

    def add_timeline(self, dataset: Dataset, inspection: "Inspection") -> None:
        """Draw what was recorded, and where something is the matter with it."""
        sensors = {name: _thinned(record) for name, record in dataset.sensors.items()}
        self._add("timeline", "timeline", sensors, inspection)

    def add_mission(self, design: "Design", band: "Band") -> None:
        """Draw a designed run before it is made, beside the spiral that it was compared with."""
        shown = dict.fromkeys((design.chosen, "spiral"))
        percents = {name: design.trials[name].percent() for name in shown}
        self._add("mission", "mission", design.truth.time, design.truth.inputs, band, design.symbols, percents)

    def add_campaign(self, findings: "CampaignSummary", filters: dict[str, str]) -> None:
        """Draw the spread of the errors of each filter variant, and a map where two settings vary."""
        self._add("spread", "spread", findings.runs, findings.columns, filters)
        if len(findings.columns) > 1:
            self._add("map", "map", findings.filters, findings.columns, filters)

    def finish(self, progress: Callable[[int, int], None] = lambda done, total: None) -> list[Path]:
        """Wait until all are drawn.

        Parameters
        ----------
        progress : callable
            Told how many figures are done, and of how many.

        Returns
        -------
        list of pathlib.Path

        Raises
        ------
        FileError
            If a file cannot be written; it is then not there, or as it was before.
        """
        for done, _ in enumerate(as_completed(self._drawn.values()), 1):
            progress(done, len(self._drawn))
        return [path for future in self._drawn.values() for path in future.result()]

    def _add(self, name: str, kind: str, *arguments: Any) -> None:
        self._drawn[name] = self._submit(draw_and_save, kind, arguments, self._folder, name, self._formats)


@contextmanager
def drawing(folder: Path, formats: Collection[FigureFormat] | None) -> Iterator[FigureQueue]:
    """Say where to put the figures of a results folder, and as what, PNG if nothing; with workers that draw them."""
    with workers.figure_workers() as submit:
        yield FigureQueue(folder / "figures", submit, formats or (FigureFormat.PNG,))


def _records_of(quantities: Sequence[Quantity], sensors: dict[str, SensorRecord]) -> dict[str, SensorRecord]:
    """Pick the sensors that measure any of some quantities; of a long record evenly spaced samples."""
    symbols = {quantity.symbol for quantity in quantities}
    return {
        name: _thinned(record)
        for name, record in sensors.items()
        if symbols & {state_of(component) for component in SENSORS[name]}
    }


def _thinned(record: SensorRecord) -> SensorRecord:
    every = slice(None, None, 1 + record.time.size // _MOST_SAMPLES)
    return SensorRecord(record.time[every], record.values[every], record.standard_deviation)
