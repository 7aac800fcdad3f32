"""Results of runs of a campaign: rows for the run, each coefficient, motion state and sensor; outcomes and errors."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from auvid_cli.arrays import Array, wrap
from auvid_cli.data.dataset import TruthRecord
from auvid_cli.data.estimate import Estimate
from auvid_cli.evaluation.accuracy import (
    CoefficientResult,
    average_steady_state_error,
    coefficient_results,
    normalised_estimation_error,
)
from auvid_cli.evaluation.judgement import Judgement, status_of
from auvid_cli.vehicle.parameters import MOTION

if TYPE_CHECKING:
    import pandas as pd

_ANGLES = ("phi", "theta", "psi")


class Measure(NamedTuple):
    """A row of the results of a campaign; fields that do not apply to its kind are None."""

    run: str  # identity of the run
    filter: str  # name of the filter variant
    seed: int
    kind: str  # "run", "coefficient", "motion" (a state) or "sensor"
    name: str  # of a coefficient, motion state or sensor
    unit: str  # SI
    status: str  # status of the run, see `auvid_cli.evaluation.judgement.status_of`
    grade: str  # judgement of the estimate, see `auvid_cli.evaluation.judgement`
    reason: str  # of the judgement
    true: float | None = None  # true value of a coefficient
    estimate: float | None = None  # of a coefficient at the last time
    standard_deviation: float | None = None  # nominal, of the estimate
    rmse: float | None = None  # RMSE of a coefficient or motion state over the whole run
    steady_state_error_percent: float | None = None  # error of a coefficient; for a run, the mean over its coefficients
    cramer_rao_bound: float | None = None  # of a coefficient
    times_bound: float | None = None  # standard deviation as a multiple of the bound
    identified: bool | None = None  # whether the estimate of a coefficient is sound and certain enough
    squares: float | None = None  # sum of the normalised innovations squared of a sensor, or NEES of a run
    components: int | None = None  # number of terms of `squares`
    processor_time: float | None = None  # of the filter alone, s
    wall_time: float | None = None  # of the filter alone, s
    # Corrected standard deviation of a coefficient, by a batch estimator
    corrected_standard_deviation: float | None = None
    total_standard_deviation: float | None = None
    largest_error_sigmas: float | None = None  # of a run: largest error of a coefficient, in total standard deviations
    additions: str | None = None  # what `auvid fit` added to the model; None for a filter


# Fields that a measure of a coefficient takes from its result.
_OF_COEFFICIENT = {*Measure._fields} & {*CoefficientResult._fields} - {"filter", "unit"}


def measures(
    run: str,
    filter_name: str,
    seed: int,
    estimate: Estimate,
    truth: TruthRecord,
    bounds: Mapping[str, float],
    judgement: Judgement,
    additions: str | None = None,
) -> list[Measure]:
    """Return all rows of a run; `bounds` has the known Cramer-Rao bounds by symbol, SI."""
    status = status_of(estimate, judgement)

    def row(kind: str, name: str = "", unit: str = "") -> Measure:
        return Measure(run, filter_name, seed, kind, name, unit, status, judgement.grade, judgement.reason)

    results = coefficient_results(estimate, truth, bounds, judgement)
    error = normalised_estimation_error(estimate, truth) if estimate.completed else None
    rows = [
        row("run")._replace(
            steady_state_error_percent=average_steady_state_error(results),
            squares=error,
            components=len(results),
            processor_time=estimate.cpu_time,
            wall_time=estimate.wall_time,
            largest_error_sigmas=_largest_error(results),
            additions=additions,
        )
    ]
    rows += [
        row("coefficient", result.coefficient, result.unit)._replace(**{f: getattr(result, f) for f in _OF_COEFFICIENT})
        for result in results
    ]
    rows += [
        row("motion", quantity.symbol, quantity.unit)._replace(rmse=_rmse(estimate, truth, i, quantity.symbol))
        for i, quantity in enumerate(MOTION)
    ]
    for sensor, innovations in estimate.innovations.items():
        sums = innovations.sums()
        squares, components = float(sums.squares.sum()), int(sums.components.sum())
        rows.append(row("sensor", sensor)._replace(squares=squares, components=components))
    return rows


def _largest_error(results: Sequence[CoefficientResult]) -> float | None:
    errors = [
        abs(result.estimate - result.true) / result.total_standard_deviation
        for result in results
        if result.true is not None and result.estimate is not None and result.total_standard_deviation
    ]
    return max(errors, default=None)


def _rmse(estimate: Estimate, truth: TruthRecord, state: int, symbol: str) -> float | None:
    if not estimate.completed:
        return None
    error = estimate.mean[:, estimate.state.index(symbol)] - np.interp(
        estimate.time, truth.time, truth.motion[:, state]
    )
    if symbol in _ANGLES:
        error = wrap(error)
    return float(np.sqrt(np.mean(error**2)))


def ended(rows: "pd.DataFrame") -> "pd.Series":
    """Whether the run of each row reached the end of its data."""
    return rows["status"].str.startswith(("completed", "inconsistent"))


def failed(rows: "pd.DataFrame") -> "pd.Series":
    """Whether the run of each row ended with an error."""
    return rows["status"].str.startswith("failed")


def diverged(rows: "pd.DataFrame") -> "pd.Series":
    """Whether the filter of each row did not reach the end of its data."""
    return ~ended(rows) & ~failed(rows)


def inconsistent(rows: "pd.DataFrame") -> "pd.Series":
    """Whether the innovations of each row contradict its estimate."""
    return rows["status"].str.startswith("inconsistent")


class CellErrors(NamedTuple):
    """Errors of the runs of a campaign with the same settings and filter."""

    key: tuple[Any, ...]  # value of each axis
    filter: str  # name of the filter variant
    errors: Array  # mean steady-state error of each run that ended and has one, shape (n,), %
    ended: int  # number of runs that reached the end of their data
    runs: int  # number of all runs

    @property
    def lost(self) -> float:
        """Return the share of runs that failed or diverged."""
        return 1.0 - self.ended / self.runs


def errors_by_cell(runs: "pd.DataFrame", columns: Sequence[str]) -> list[CellErrors]:
    """Return the errors of each combination of settings and filter, in the order of the runs.

    Parameters
    ----------
    runs : DataFrame
        A row for each run: axes, filter, status, steady_state_error_percent.
    columns : sequence of str
        Axes.
    """
    cells = []
    for key, rows in runs.groupby([*columns, "filter"], sort=False):
        *settings, name = key if isinstance(key, tuple) else (key,)
        errors = rows["steady_state_error_percent"].dropna().to_numpy(np.float64)
        cells.append(CellErrors(tuple(settings), str(name), errors, int(ended(rows).sum()), len(rows)))
    return cells
