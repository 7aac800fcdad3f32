"""Results of a validation: measures of fit, scores in words, and tables."""

from collections.abc import Sequence
from math import inf, isfinite, sqrt
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from auvid_cli.arrays import Array
from auvid_cli.data.checks import Check, Checks, NamedRows, frames
from auvid_cli.data.dataset import Dataset
from auvid_cli.evaluation.results import FreeRun
from auvid_cli.text import degrees_for

if TYPE_CHECKING:
    import pandas as pd

    from auvid_cli.evaluation.judgement import Judgement

# Kinds of predictions: those ahead are of all measurements, of those in turns, and of those on straight legs.
FREE_RUN = "free_run"
AHEAD = "ahead"
TURNS = "ahead_in_turns"
LEGS = "ahead_on_straight_legs"
_WHERE = {TURNS: " in turns", LEGS: " on straight legs", AHEAD: ""}
_SCORED = {"r": "yaw rate", "v": "sway"}  # signals that show a turn
_SCORED_HORIZON = 20.0  # s, longest
_MARGIN = 0.1  # share of an error below which two models predict equally well
_MIN_MULTIPLE = 2.0  # ratio of errors from which it is stated as a multiple instead of percent
_VISIBLE = 1.1  # ratio to the noise below which an error is that of the measurement
# Names of checks.
STABLE = "stable"
COMPLETED = "filter completed"
UNCERTAINTY_NOT_TOO_SMALL = "uncertainty not too small"
UNCERTAINTY_NOT_TOO_LARGE = "uncertainty not too large"
MIN_ERROR = 3.0  # standard deviations of a measurement, above which an error is more than noise
MAX_ERROR_RATIO = 1.1  # ratio to the error of another model; over short horizons all models are nearly equal
MAX_NIS = 1.5  # mean per component of a sensor, up to which the settings hold


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
    kind: str  # `FREE_RUN`: all measurements of the run; `AHEAD`, `TURNS`, `LEGS`: a horizon after many starts
    horizon_s: float  # time from the start to the measurements; for a free run its length
    measurements: int
    noise: float  # stated standard deviation of a measurement: a lower bound of the RMSE
    fit_percent: float | None  # fit of the identified model, relative to the measurements of the whole run
    rmse: float | None  # RMSE of the identified model
    prior_rmse: float | None  # RMSE of the prior's mean
    vehicle_file_rmse: float | None  # RMSE of the unchanged vehicle file; None if it lacks a coefficient
    constant_velocity_rmse: float | None  # RMSE of the unchanged motion at the start
    # RMSE due to the uncertainties of coefficients, start and measurements, and to the larger of process noise and the
    # excess errors in predictions of the estimate's own data, if available
    expected_rmse: float | None = None
    share_within_band: float | None = None  # share of the errors within 2 `expected_rmse`; ideally 0.95
    draws: int | None = None  # number of sets of coefficients drawn from the estimate's covariance
    draws_blown_up: int | None = None  # number of these that diverged after any start; the band is without them
    independent: float | None = None  # effective number of independent errors of all starts, see `independent_errors`


def error_ratios(rows: Sequence[Prediction], other: str) -> dict[str, float]:
    """Return the ratio of the model's error to another one by signal: geometric mean over horizons beyond the noise.

    `other` is a field of `Prediction`. A model that diverged has an infinite error.
    """
    logs: dict[str, list[float]] = {}
    for row in rows:
        error: float | None = getattr(row, other)
        if error is not None and error > MIN_ERROR * row.noise:
            logs.setdefault(row.signal, []).append(inf if row.rmse is None else float(np.log(row.rmse / error)))
    return {symbol: float(np.exp(np.mean(own))) for symbol, own in logs.items()}


class Score(NamedTuple):
    """Error of the predictions of a signal over one horizon, next to those of the vehicle file and unchanged motion."""

    signal: str
    kind: str  # `TURNS`, `LEGS`, or `AHEAD` if the data have neither
    horizon_s: float
    unit: str  # SI
    noise: float  # stated standard deviation of a measurement
    model: float
    vehicle_file: float | None  # None if the file lacks a coefficient, or its model diverged
    unchanged: float | None

    @property
    def other(self) -> tuple[str, float | None]:
        """Return name and error of the model to compare with: the vehicle file, or without one an unchanged motion."""
        if self.vehicle_file is not None:
            return "vehicle file", self.vehicle_file
        return "unchanged motion", self.unchanged

    @property
    def gain(self) -> float:
        """Return the share by which the error is smaller than that of the other; 0 without one, or within the noise."""
        other = self.other[1]
        is_noise = other is not None and max(self.model, other) < _VISIBLE * self.noise
        return 0.0 if not other or is_noise else 1.0 - self.model / other

    def __str__(self) -> str:
        factor, unit = degrees_for(self.unit)
        where = f"{_SCORED[self.signal].capitalize()}{_WHERE[self.kind]} {self.horizon_s:g} s ahead"
        text, (name, other) = f"{where}: {factor * self.model:.3g} {unit}", self.other
        return text if other is None else f"{text}, {name} {factor * other:.3g}: {_compared(self.model, other)}"


def _compared(error: float, other: float) -> str:
    """Return by how much an error is smaller or larger than another, in words."""
    if f"{error:.3g}" == f"{other:.3g}":
        return "the same"
    ratio = error / other
    if ratio >= _MIN_MULTIPLE:
        return f"{ratio:.{0 if ratio >= 10.0 else 1}f} times as large"
    percent = 100.0 * abs(1.0 - ratio)
    size = f"{percent:.0f} %" if percent >= 1.0 else "less than 1 %"
    return f"{size} {'better' if error < other else 'worse'}"


def scores_of(rows: Sequence[Prediction]) -> tuple[Score, ...]:
    """Return the scores of yaw rate and sway at the longest horizon up to 20 s: in turns, then on straight legs."""
    kinds = {row.kind for row in rows}
    scores = []
    for kind in [kind for kind in (TURNS, LEGS) if kind in kinds] or [AHEAD]:
        for signal in _SCORED:
            own = [row for row in rows if (row.kind, row.signal) == (kind, signal) and row.horizon_s <= _SCORED_HORIZON]
            row = max(own, key=lambda row: row.horizon_s, default=None)
            if row is not None and row.rmse is not None:
                errors = row.rmse, row.vehicle_file_rmse, row.constant_velocity_rmse
                scores.append(Score(signal, kind, row.horizon_s, row.unit, row.noise, *errors))
    return tuple(scores)


def verdict_on(scores: Sequence[Score]) -> str:
    """Return whether a model is recommended, in a sentence; empty if it predicts turns, or else all, better."""
    first = [score for score in scores if score.kind == scores[0].kind]
    if not first:
        return ""
    name = first[0].other[0]
    if min(score.gain for score in first) < -_MARGIN:
        return f"The model predicts worse than the {name}: it is not recommended."
    return f"The {name} predicts as well." if max(score.gain for score in first) <= _MARGIN else ""


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

    @property
    def scores(self) -> tuple[Score, ...]:
        """Return the errors of yaw rate and sway in turns and on straight legs, next to those of the vehicle file."""
        return scores_of(self.predictions)

    @property
    def has_only_wide_bands(self) -> bool:
        """Whether the only failure is an uncertainty that is too large."""
        return {check.check for check in self.checks.failed()} == {UNCERTAINTY_NOT_TOO_LARGE}

    def worse_than_the_mean(self, kind: str) -> list[str]:
        """Return the signals that a prediction of a kind explains worse than their mean does."""
        fits = ((row.signal, row.fit_percent) for row in self.predictions if row.kind == kind)
        return list(dict.fromkeys(signal for signal, fit in fits if fit is not None and fit < 0.0))

    def conclusion(self) -> str:
        """Return the end of a sentence that names the predicted signals, and those that are not."""
        failed = {check.check for check in self.checks if check.passed is False}
        worse = {"in the free run": self.worse_than_the_mean(FREE_RUN), "ahead": self.worse_than_the_mean(AHEAD)}
        ahead = [row for row in self.predictions if row.kind == AHEAD]
        ratios = [error_ratios(ahead, other) for other in ("constant_velocity_rmse", "prior_rmse")]
        beaten = {symbol for each in ratios for symbol, ratio in each.items() if ratio > MAX_ERROR_RATIO}
        signals = dict.fromkeys(row.signal for row in self.predictions)
        beaten |= {row.signal for row in self.predictions if row.rmse is None}
        predicted = [s for s in signals if s not in beaten and all(s not in own for own in worse.values())]
        if COMPLETED in failed or not predicted:
            text = "does not predict these data."
        elif len(predicted) == len(signals):
            text = "predicts these data."
        else:
            text = f"predicts {', '.join(predicted)} of these data."
        bands = {UNCERTAINTY_NOT_TOO_SMALL: "some bands too narrow", UNCERTAINTY_NOT_TOO_LARGE: "bands too wide"}
        if (wrong := [words for name, words in bands.items() if name in failed]) and predicted:
            text = f"{text.removesuffix('.')}, with {' and '.join(wrong)}."
        if beaten:
            text += f" Worse than another prediction: {', '.join(s for s in signals if s in beaten)}."
        where = "; ".join(f"{', '.join(own)} {how}" for how, own in worse.items() if own)
        return f"{text} Worse than their mean (fit below 0): {where}." if where else text
