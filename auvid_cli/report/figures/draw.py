"""Which figures a run gets."""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, as_completed
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args

from auvid_cli.data.dataset import Dataset, SensorRecord
from auvid_cli.data.estimate import Estimate
from auvid_cli.report.figures import workers
from auvid_cli.report.figures.workers import Submit, draw_and_save
from auvid_cli.vehicle.coefficients import CoefficientGroup
from auvid_cli.vehicle.parameters import MOTION, MOTION_SYMBOLS, SENSORS, Quantity

if TYPE_CHECKING:
    from auvid_cli.campaign.findings import Findings

    # They bring the compiled core along, which is loaded elsewhere, and said to be.
    from auvid_cli.design.band import Band
    from auvid_cli.design.conclusion import Design
    from auvid_cli.evaluation.assessment import Identifiability
    from auvid_cli.evaluation.evaluate import Evaluation
    from auvid_cli.inspection.inspection import Inspection
    from auvid_cli.validation.results import Validation

# Of one sensor, as many as any figure can show.
_MOST_SAMPLES = 100_000


class FigureQueue:
    """Figures of a run, each as PNG (150 dpi) and SVG, drawn as soon as what they show is there.

    Parameters
    ----------
    folder : pathlib.Path
        Made if it is missing.
    submit : callable
        As `Executor.submit`, to those who draw. They are handed no more data than a figure needs: it may travel to
        another process.
    """

    def __init__(self, folder: Path, submit: Submit) -> None:
        self._folder = folder
        self._submit = submit
        self._drawn: dict[str, Future[list[Path]]] = {}

    def add_innovations(self, estimate: Estimate) -> None:
        """Draw what only one filter is needed for."""
        if estimate.innovations:
            self._add(f"innovations_{estimate.filter}", "innovations", estimate.course((), with_innovations=True))

    def add_path(self, dataset: Dataset, estimates: Sequence[Estimate] = ()) -> None:
        """Draw where the vehicle went, which takes an estimate where the truth is not known; once."""
        if "path" not in self._drawn and (dataset.truth is not None or estimates):
            self._add("path", "path", dataset.truth, [estimate.course(MOTION_SYMBOLS) for estimate in estimates])

    def add_others(self, dataset: Dataset, estimates: list[Estimate], evaluation: "Evaluation") -> None:
        """Draw what shows all filters together, free runs against the measurements; those of many panels first."""
        wanted: list[tuple[Any, ...]] = []
        state = {symbol for estimate in estimates for symbol in estimate.state}
        true = dataset.truth.coefficients if dataset.truth is not None else {}
        known = dict.fromkeys(c for estimate in estimates for c in estimate.coefficient_set)
        for group in get_args(CoefficientGroup):
            members = [c for c in known if c.group == group and c.symbol in state]
            if members:
                courses = [estimate.course([c.symbol for c in members]) for estimate in estimates]
                wanted.append((len(members), f"coefficients_{group}", "coefficients", members, courses, true))
        if evaluation.free_runs or dataset.sensors:
            for name, quantities in (("velocities", MOTION[:6]), ("attitude", MOTION[6:])):
                sensors = _records_of(quantities, dataset.sensors)
                wanted.append((2 * len(quantities), name, "motion", quantities, sensors, evaluation.free_runs))
        for _, *figure in sorted(wanted, key=lambda figure: figure[0], reverse=True):
            self._add(*figure)
        self.add_path(dataset, estimates)

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

    def add_timeline(self, inspection: "Inspection") -> None:
        """Draw what was recorded when, and where something is the matter with it."""
        self._add("timeline", "timeline", inspection)

    def add_mission(self, design: "Design", band: "Band") -> None:
        """Draw a designed run before it is made, beside the spiral that it was compared with."""
        shown = ("spiral",) if design.is_own else ("designed", "spiral")
        percents = {name: design.trials[name].percent() for name in shown}
        self._add("mission", "mission", design.truth.time, design.truth.inputs, band, design.symbols, percents)

    def add_campaign(self, findings: "Findings", filters: dict[str, str]) -> None:
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
        self._drawn[name] = self._submit(draw_and_save, kind, arguments, self._folder, name)


@contextmanager
def drawing(folder: Path) -> Iterator[FigureQueue]:
    """Say where to put the figures of a results folder, with workers that draw them."""
    with workers.figure_workers() as submit:
        yield FigureQueue(folder / "figures", submit)


def _records_of(quantities: Sequence[Quantity], sensors: dict[str, SensorRecord]) -> dict[str, SensorRecord]:
    """Pick the sensors that measure any of some quantities; of a long record evenly spaced samples."""
    records = {}
    for name, record in sensors.items():
        if set(quantities) & set(SENSORS[name]):
            every = slice(None, None, 1 + record.time.size // _MOST_SAMPLES)
            records[name] = SensorRecord(record.time[every], record.values[every], record.standard_deviation)
    return records
