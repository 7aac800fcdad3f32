"""Results of a validation: measures of fit, tables, and checks of the predictions."""

from collections.abc import Callable, Mapping, Sequence
from math import inf, isfinite, sqrt
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from auvid_cli.arrays import Array
from auvid_cli.data.checks import Check, Checks, NamedRows, frames
from auvid_cli.data.dataset import Dataset
from auvid_cli.evaluation.results import FreeRun

if TYPE_CHECKING:
    import pandas as pd

    from auvid_cli.evaluation.judgement import Judgement

FREE_RUN, AHEAD = "free_run", "ahead"
UNCERTAINTY_NOT_TOO_LARGE = "uncertainty not too large"
MAX_NIS = 1.5  # mean per component of a sensor, up to which the settings hold
_MIN_ERROR = 3.0  # standard deviations of a measurement, above which an error is more than noise
_MAX_ERROR_RATIO = 1.1  # ratio to the error of another model; over short horizons all models are nearly equal
_MAX_EXCURSION_RATIO = 10.0  # ratio to the largest distance of the measurements from their mean
# Smallest share of the errors within two standard deviations: below 0.95, because successive starts are correlated.
_MIN_BAND_SHARE = 0.85
_MAX_BAND_SHARE = 0.995
_MIN_MEASUREMENTS = 60  # for a share within the band; with fewer, one of dozens of rows is too small by chance
_MAX_NOISE_SHARE = 0.7  # share of noise in a band; more hides whether the model's uncertainty is too large
# With this number of independent errors a correct band misses at least one with a probability of 95 %, 1 - 0.95^59.
_MIN_INDEPENDENT = 59.0


def independent_errors(errors: Array) -> float:
    """Return the effective number of independent errors, at most their number.

    A common error of all starts counts as correlation, since errors are not centred. Correlations are summed in pairs
    of lags until a sum is not positive (C. J. Geyer, "Practical Markov chain Monte Carlo", Statistical Science 7(4),
    1992).

    Parameters
    ----------
    errors : ndarray, shape (n,)
        In the order of their starts, normalised; n of at least 1.
    """
    n = errors.size
    square = float(errors @ errors)
    if square == 0.0:
        return 1.0
    by_lag = np.correlate(errors, errors, "full")[n - 1 :] / square
    pairs = by_lag[: n - n % 2].reshape(-1, 2).sum(axis=1)
    ends = np.flatnonzero(pairs <= 0.0)
    correlation_time = 2.0 * float(pairs[: ends[0] if ends.size else pairs.size].sum()) - 1.0
    return n / max(correlation_time, 1.0)


class PredictionFit(NamedTuple):
    """Sums over measurements and their predictions."""

    measurements: int = 0
    mean: float = 0.0  # mean of the measurements
    spread: float = 0.0  # sum of squared deviations of the measurements from their mean
    squares: float = 0.0  # sum of squared errors; not finite if a prediction is not

    @classmethod
    def of(cls, measured: Array, predicted: Array) -> "PredictionFit":
        """Return the sums over measurements and predictions, shape (n,), in one unit; angles are unwrapped."""
        if not measured.size:
            return cls()
        mean = float(measured.mean())
        with np.errstate(over="ignore", invalid="ignore"):
            squares = float(np.square(measured - predicted).sum())
        return cls(measured.size, mean, float(np.square(measured - mean).sum()), squares)

    def plus(self, other: "PredictionFit") -> "PredictionFit":
        """Return the sums over both, with deviations from the common mean (Chan, Golub and LeVeque, 1983)."""
        measurements = self.measurements + other.measurements
        if not measurements:
            return self
        difference = other.mean - self.mean
        mean = self.mean + difference * other.measurements / measurements
        spread = self.spread + other.spread + difference**2 * self.measurements * other.measurements / measurements
        return PredictionFit(measurements, mean, spread, self.squares + other.squares)

    def with_segment(self, other: "PredictionFit") -> "PredictionFit":
        """Return the sums over both, with deviations from the mean of each segment."""
        measurements = self.measurements + other.measurements
        mean = (self.measurements * self.mean + other.measurements * other.mean) / max(measurements, 1)
        return PredictionFit(measurements, mean, self.spread + other.spread, self.squares + other.squares)

    @property
    def rmse(self) -> float | None:
        """Return the root mean square error; None without measurements or with predictions that are not finite."""
        return sqrt(self.squares / self.measurements) if self.measurements and isfinite(self.squares) else None

    @property
    def percent(self) -> float | None:
        """Return 100 (1 - norm of errors / norm of deviations from the mean): 100 is perfect, 0 is as good as the mean.

        None as for `rmse` and for constant measurements; it can be any negative number.
        """
        varies = self.rmse is not None and 0.0 < self.spread < inf
        return 100.0 * (1.0 - sqrt(self.squares / self.spread)) if varies else None


class Prediction(NamedTuple):
    """A row of ``validation.csv``; None for unknown values, and for those of a model that diverged."""

    signal: str  # motion state, or the depth (``down``)
    unit: str  # SI
    kind: str  # `FREE_RUN`: all measurements of the run; `AHEAD`: a horizon after many starts
    horizon_s: float  # time from the start to the measurements; for a free run its length
    measurements: int
    noise: float  # stated standard deviation of a measurement: a lower bound of the RMSE
    fit_percent: float | None  # fit of the identified model, relative to the measurements of the whole run
    rmse: float | None  # RMSE of the identified model
    prior_rmse: float | None  # RMSE of the prior's mean
    vehicle_file_rmse: float | None  # RMSE of the coefficients in the vehicle file
    constant_velocity_rmse: float | None  # RMSE of the unchanged motion at the start
    # RMSE due to the uncertainties of coefficients, start and measurements, and to the larger of process noise and the
    # excess errors in predictions of the estimate's own data, if available
    expected_rmse: float | None = None
    share_within_band: float | None = None  # share of the errors within 2 `expected_rmse`; ideally 0.95
    draws: int | None = None  # number of sets of coefficients drawn from the estimate's covariance
    draws_blown_up: int | None = None  # number of these that diverged after any start; the band is without them
    independent: float | None = None  # effective number of independent errors of all starts, see `independent_errors`


class ManoeuvreNumber(NamedTuple):
    """A row of ``manoeuvres.csv``: a characteristic number of a manoeuvre, SI; speeds as the DVL measures them."""

    manoeuvre: str  # ``zigzag 20`` (rudder in degrees) or ``turning circle 15``
    number: str  # for example ``overshoot 1`` or ``radius``
    time_s: float  # reversal of the rudder, or start of the steady turn
    unit: str
    measured: float
    predicted: float | None  # from the free run; None if not finite


class Validation(NamedTuple):
    """Predictions and checks of an estimate on other data."""

    filter: str
    judgement: "Judgement"  # judgement of the estimate by itself
    predictions: list[Prediction]  # free run, then by horizon
    manoeuvres: list[ManoeuvreNumber]
    checks: Checks
    shown: Dataset  # longest segment of the data
    run: FreeRun  # run of the identified model in that segment, as the sensors measure it
    remarks: list[str]  # sentences on limits of the validation

    def tables(self) -> dict[str, NamedRows]:
        """Return the rows of each CSV file, by its name."""
        return {
            "validation": NamedRows(Prediction._fields, self.predictions),
            "manoeuvres": NamedRows(ManoeuvreNumber._fields, self.manoeuvres),
            "validation_checks": NamedRows(Check._fields, self.checks),
        }

    def to_pandas(self) -> "dict[str, pd.DataFrame]":
        """Return tables as the CSV files: ``validation``, ``manoeuvres`` and ``validation_checks``."""
        return frames(self.tables())

    def worse_than_the_mean(self, kind: str) -> list[str]:
        """Return the signals that a prediction of a kind explains worse than their mean does."""
        fits = ((row.signal, row.fit_percent) for row in self.predictions if row.kind == kind)
        return list(dict.fromkeys(signal for signal, fit in fits if fit is not None and fit < 0.0))


def prediction_checks(
    name: str, rows: Sequence[Prediction], excursion: Mapping[str, float], nis: Mapping[str, float], status: str
) -> list[Check]:
    """Return all checks of the predictions of one estimate.

    Parameters
    ----------
    name : str
        Filter of the estimate.
    rows : sequence of Prediction
    excursion : mapping of float
        By signal, of the free run, see `FreeRunFit`.
    nis : mapping of float
        By sensor, of the filter that finds the initial states, see `InitialStates`.
    status : str
        Status of that filter.
    """
    ahead = [row for row in rows if row.kind == AHEAD]
    stable = Check.of_values(
        name,
        "free run",
        "stable",
        excursion,
        limit=_MAX_EXCURSION_RATIO,
        unit="times",
        meaning="the range of the measurements",
        advice="The free run leaves the range of the measurements. If the vehicle is unstable in open loop, use the "
        "predictions ahead instead; otherwise the coefficients are wrong: run `auvid check` on the estimate.",
    )
    completed = Check.of(
        name,
        "start",
        "filter completed",
        statistic=status,
        threshold="to the end of the data",
        passed=status == "completed",
        advice="No filter follows these measurements with this model. Predictions start only before that time: run "
        "`auvid inspect` on the data, and check that the vehicle is the same.",
    )
    checks = [stable, completed]
    if ahead:
        checks += [
            _better(name, "constant velocity", ahead, lambda row: row.constant_velocity_rmse),
            _better(name, "the prior", ahead, lambda row: row.prior_rmse),
            *_band_checks(name, ahead),
        ]
    checks.append(
        Check.of_values(
            name,
            "one measurement ahead",
            "NIS",
            nis,
            limit=MAX_NIS,
            meaning="per component",
            advice="From one measurement to the next the errors are larger than the settings predict: coefficients are "
            "wrong, the model lacks an effect of this run, or these sensors are worse than stated. Run `auvid tune` on "
            "this run.",
            fails=False,
        )
    )
    return checks


def _better(name: str, other: str, rows: Sequence[Prediction], rmse_of: Callable[[Prediction], float | None]) -> Check:
    """Check that the model has smaller errors than another, wherever those are more than noise."""
    ratios = []
    for row in rows:
        other_rmse = rmse_of(row)
        if other_rmse is not None and other_rmse > _MIN_ERROR * row.noise:
            ratios.append((row, row.rmse / other_rmse if row.rmse is not None else inf))
    if not ratios:
        return Check.of(
            name,
            "ahead",
            f"better than {other}",
            statistic="-",
            threshold="errors larger than noise",
            passed=None,
            advice=f"Not checked: the errors of {other} are noise, or it diverged. Validate on a run with more motion.",
        )
    return Check.of_values(
        name,
        "ahead",
        f"better than {other}",
        _worst(ratios),
        limit=_MAX_ERROR_RATIO,
        unit="times",
        meaning="its error, where that is more than noise",
        advice="Do not use the model for these signals: the coefficients of that motion are wrong, or the vehicle has "
        "changed.",
    )


def _band_checks(name: str, rows: Sequence[Prediction]) -> list[Check]:
    """Check the stated uncertainty against the errors: not too small, nor, over all horizons, too large."""
    banded = [row for row in rows if row.share_within_band is not None]
    # A model that diverged has no band, so no error is within it.
    expected = [row for row in rows if row.draws or row.share_within_band is not None]
    shares = [(row, row.share_within_band or 0.0) for row in expected if row.measurements >= _MIN_MEASUREMENTS]
    if not shares:
        return []
    too_small = Check.of_values(
        name,
        "ahead",
        "uncertainty not too small",
        _worst(shares, is_least=True),
        limit=_MIN_BAND_SHARE,
        meaning="of the errors within two sigma",
        advice="Errors are larger than the uncertainty of coefficients, start, sensors and process noise. The "
        "structure of the model is wrong for this manoeuvre, or process noise or covariance is too small (run `auvid "
        "tune`). A share of 0 means that the model diverged.",
        is_least=True,
    )
    return [too_small, _too_large(name, banded)]


def _too_large(name: str, rows: Sequence[Prediction]) -> Check:
    """Check, by signal and over all horizons, that some errors leave their band.

    Errors of the coefficients are the same at every start and may be small. So a signal counts only if at some horizon
    enough errors are independent.
    """
    within: dict[str, float] = {}
    for signal in dict.fromkeys(row.signal for row in rows):
        own = [
            row for row in rows if row.signal == signal and (row.expected_rmse or 0.0) * _MAX_NOISE_SHARE > row.noise
        ]
        if not any((row.independent or 0.0) >= _MIN_INDEPENDENT for row in own):
            continue
        if count := sum(row.measurements for row in own):
            within[signal] = sum((row.share_within_band or 0.0) * row.measurements for row in own) / count
    if not within:
        statistic, threshold = "-", f"{_MIN_INDEPENDENT:g} independent errors larger than noise"
        return Check.of(
            name, "ahead", UNCERTAINTY_NOT_TOO_LARGE, statistic=statistic, threshold=threshold, passed=True, advice=""
        )
    return Check.of_values(
        name,
        "ahead",
        UNCERTAINTY_NOT_TOO_LARGE,
        within,
        limit=_MAX_BAND_SHARE,
        meaning="of the errors within two sigma",
        advice="The model is better than its uncertainty: its own data were harder to predict, or process noise is set "
        "too large (run `auvid tune`).",
    )


def _worst(values: Sequence[tuple[Prediction, float]], is_least: bool = False) -> dict[str, float]:
    """Return the largest (or smallest) value of each signal, by signal and horizon."""
    worst: dict[str, tuple[Prediction, float]] = {}
    for row, value in sorted(values, key=lambda pair: pair[1], reverse=not is_least):
        worst.setdefault(row.signal, (row, value))
    return {f"{row.signal} at {row.horizon_s:g} s": value for row, value in worst.values()}
