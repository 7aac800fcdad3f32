"""The free run against every measurement: the identified model, what there was before, and an unchanged motion."""

from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.data.dataset import Dataset, SensorRecord
from auvid_cli.evaluation.free_run import Keeper, free_motion
from auvid_cli.evaluation.measurement_errors import as_read
from auvid_cli.evaluation.motion import FreeRun
from auvid_cli.identification.timeline import Timelines
from auvid_cli.validation.fit import Fit
from auvid_cli.validation.initial_states import InitialStates
from auvid_cli.validation.models import Models
from auvid_cli.validation.prediction import unchanged_motion
from auvid_cli.validation.results import FREE_RUN, Prediction
from auvid_cli.validation.signals import SAME, Signal, is_angle
from auvid_cli.vehicle.parameters import MOTION, MOTION_SYMBOLS, N_MOTION

Array = NDArray[np.float64]


class FreeRunFit(NamedTuple):
    """Fit of the free runs to all measurements.

    Attributes
    ----------
    run : FreeRun
        Of the identified model, as the sensors read it: with their errors, and where a current is estimated over
        ground. Of a long run evenly spaced samples.
    rows : list of Prediction
    excursion : dict of float
        How far the run went from the mean of each signal but the heading, over how far the measurements went; infinite
        where it is not finite.
    """

    run: FreeRun
    rows: list[Prediction]
    excursion: dict[str, float]


def fit_free_runs(
    dataset: Dataset,
    measuring: Mapping[str, SensorRecord],
    signals: Mapping[str, Signal],
    models: Models,
    starts: InitialStates,
) -> FreeRunFit:
    """Run each model from the first start to the end of the data, and compare.

    Parameters
    ----------
    dataset : Dataset
        From `with_model`.
    measuring, signals : mapping
    models : Models
    starts : InitialStates
        At least one. The first measurements alone would be a poor start: their noise, and an attitude reference that
        has not settled, would stay in all that follows. Measurements are predicted with the sensors' errors and the
        current that the filter knows at the end; where these walk, how they were before is left out.
    """
    start, motion, errors = float(starts.time[0]), starts.motion[0], starts.final_errors
    timelines = Timelines(dataset.inputs, dict(measuring), start, dataset.experiment.identification.integration_step)
    parameters = dataset.experiment.vehicle.known_parameters()
    keeper, farthest = Keeper(measuring), np.zeros(N_MOTION)
    centres = np.array([signals[s].values.mean() if s in signals else 0.0 for s in MOTION_SYMBOLS])

    def watched() -> Iterator[tuple[Array, Array]]:
        for timeline, predicted in free_motion(timelines, motion, parameters, models.identified):
            read = as_read(predicted, errors)
            keeper.keep(timeline.time, read)
            with np.errstate(invalid="ignore"):
                farthest[:] = np.maximum(farthest, np.abs(read - centres).max(axis=0))
            yield timeline.time, read

    def others(coefficients: Mapping[str, float]) -> Iterator[tuple[Array, Array]]:
        for timeline, predicted in free_motion(timelines, motion, parameters, coefficients):
            yield timeline.time, as_read(predicted, errors)

    def unchanged() -> Iterator[tuple[Array, Array]]:
        angles = motion[6:9]
        for timeline in timelines:
            predicted = unchanged_motion(timeline.time - start, motion, angles)
            angles = predicted[-1, 6:9]
            yield timeline.time, as_read(predicted, errors)

    runs = {"identified": watched(), "constant_velocity": unchanged()}
    runs |= {name: others(values) for name, values in models._asdict().items() if values and name != "identified"}
    fits = {name: _fits(run, signals) for name, run in runs.items()}
    length = timelines.span[1] - start

    def rmse(name: str, symbol: str) -> float | None:
        return fits[name][symbol].rmse if name in fits else None

    rows = [
        Prediction(
            symbol,
            MOTION[MOTION_SYMBOLS.index(symbol)].unit,
            FREE_RUN,
            length,
            fits["identified"][symbol].measurements,
            signal.deviation,
            fits["identified"][symbol].percent,
            rmse("identified", symbol),
            rmse("prior", symbol),
            rmse("vehicle_file", symbol),
            rmse("constant_velocity", symbol),
        )
        for symbol, signal in signals.items()
    ]
    reach = {s: float(np.abs(g.values - g.values.mean()).max()) + g.deviation for s, g in signals.items()}
    excursion = {
        symbol: float(np.nan_to_num(farthest[column], nan=np.inf)) / reach[symbol]
        for column, symbol in enumerate(MOTION_SYMBOLS[:-1])
        if symbol in signals
    }
    return FreeRunFit(keeper.kept(), rows, excursion)


def _fits(run: Iterator[tuple[Array, Array]], signals: Mapping[str, Signal]) -> dict[str, Fit]:
    """Of every signal, chunk by chunk, of what is predicted of its measurements."""
    fits = dict.fromkeys(signals, Fit())
    turns: dict[str, float] = {}
    for time, predicted in run:
        for symbol, signal in signals.items():
            own = slice(*np.searchsorted(signal.time, [time[0] - SAME, time[-1] + SAME]))
            column = MOTION_SYMBOLS.index(symbol)
            expected = predicted[np.searchsorted(time, signal.time[own] - SAME), column]
            if is_angle(symbol) and symbol not in turns:
                turns[symbol] = signal.turns(float(time[0]), float(predicted[0, column]))
            fits[symbol] = fits[symbol].plus(Fit.of(signal.values[own], expected + turns.get(symbol, 0.0)))
    return fits
