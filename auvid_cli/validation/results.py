"""Results of a validation, with measures of fit and the number of independent samples."""

from math import inf, isfinite, sqrt
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.data.checks import Check, Checks, NamedRows, frames
from auvid_cli.data.dataset import Dataset
from auvid_cli.evaluation.results import FreeRun

if TYPE_CHECKING:
    import pandas as pd

    from auvid_cli.evaluation.judgement import Judgement

Array = NDArray[np.float64]
FREE_RUN, AHEAD = "free_run", "ahead"
# The check that a model fails which is better than it says.
NO_WIDER = "no wider than its errors"


def independent_errors(errors: Array) -> float:
    """Return how many independent errors are worth as much as these, in their order; at most their number.

    Their mean square is not zero if they are all the same: an error that lasts, or that every start has, counts as
    correlated. Correlations are summed in pairs of lags as long as these are positive (C. J. Geyer, "Practical Markov
    chain Monte Carlo", Statistical Science 7(4), 1992).

    Parameters
    ----------
    errors : ndarray, shape (n,)
        By their standard deviations; n of at least 1.
    """
    n = errors.size
    square = float(errors @ errors)
    if square == 0.0:
        return 1.0
    by_lag = np.correlate(errors, errors, "full")[n - 1 :] / square
    pairs = by_lag[: n - n % 2].reshape(-1, 2).sum(axis=1)
    ends = np.flatnonzero(pairs <= 0.0)
    together = 2.0 * float(pairs[: ends[0] if ends.size else pairs.size].sum()) - 1.0
    return n / max(together, 1.0)


class PredictionFit(NamedTuple):
    """Sums over measurements and their predictions.

    Attributes
    ----------
    measurements : int
        How many.
    mean : float
        Of the measurements.
    spread : float
        Sum of the squares of the measurements' deviations from their mean.
    squares : float
        Sum of the squares of the errors; not finite if a prediction is not.
    """

    measurements: int = 0
    mean: float = 0.0
    spread: float = 0.0
    squares: float = 0.0

    @classmethod
    def of(cls, measured: Array, predicted: Array) -> "PredictionFit":
        """Sum over measurements, shape (n,), and their predictions, in one unit; angles without jumps of a turn."""
        if not measured.size:
            return cls()
        mean = float(measured.mean())
        with np.errstate(over="ignore", invalid="ignore"):
            squares = float(np.square(measured - predicted).sum())
        return cls(measured.size, mean, float(np.square(measured - mean).sum()), squares)

    def plus(self, other: "PredictionFit") -> "PredictionFit":
        """Join both; the deviations by the update of Chan, Golub and LeVeque (1983)."""
        measurements = self.measurements + other.measurements
        if not measurements:
            return self
        apart = other.mean - self.mean
        mean = self.mean + apart * other.measurements / measurements
        spread = self.spread + other.spread + apart**2 * self.measurements * other.measurements / measurements
        return PredictionFit(measurements, mean, spread, self.squares + other.squares)

    def beside(self, other: "PredictionFit") -> "PredictionFit":
        """Join both, where each deviates from its own mean: that of another segment."""
        measurements = self.measurements + other.measurements
        mean = (self.measurements * self.mean + other.measurements * other.mean) / max(measurements, 1)
        return PredictionFit(measurements, mean, self.spread + other.spread, self.squares + other.squares)

    @property
    def rmse(self) -> float | None:
        """Return the root mean square error; None without measurements or where the prediction is not finite."""
        return sqrt(self.squares / self.measurements) if self.measurements and isfinite(self.squares) else None

    @property
    def percent(self) -> float | None:
        """Return 100 (1 - norm of errors / norm of deviations from the mean): 100 is perfect, 0 is the mean itself.

        None as for `rmse`, and where the measurements do not vary; it can be any negative number.
        """
        varies = self.rmse is not None and 0.0 < self.spread < inf
        return 100.0 * (1.0 - sqrt(self.squares / self.spread)) if varies else None


class Prediction(NamedTuple):
    """A row of ``validation.csv``; None stands for what is not known, or not finite because a model blew up.

    Attributes
    ----------
    signal, unit : str
        Motion state, or the depth (``down``), and its SI unit.
    kind : str
        `FREE_RUN`, against every measurement of the run, or `AHEAD`, from many starts.
    horizon_s : float
        Time from the start to the measurements; of a free run its length.
    measurements : int
        How many are compared.
    noise : float
        Stated standard deviation of a measurement, below which no RMSE can fall if it is right.
    fit_percent, rmse : float or None
        Of the identified model; the fit goes by how far the measurements of the whole run are from their mean.
    prior_rmse, vehicle_file_rmse, constant_velocity_rmse : float or None
        Of what there was before: the prior's mean, the coefficients in the vehicle file, and the motion at the start
        going on as it is.
    expected_rmse : float or None
        What the uncertainties of coefficients, start and measurements amount to, and the larger of what process noise
        adds and by how much predictions of the model's own data, where these are at hand, are worse than stated.
    share_within_band : float or None
        Of the errors, those within two of these standard deviations; 0.95 if the uncertainties are right.
    draws, draws_blown_up : int or None
        Sets of coefficients drawn from the estimate's covariance, and how many of these blew up on the way from
        one of the starts or another; those are in no band.
    independent : float or None
        Of how many independent errors those of all starts say as much, see `auvid_cli.validation.results`.
    """

    signal: str
    unit: str
    kind: str
    horizon_s: float
    measurements: int
    noise: float
    fit_percent: float | None
    rmse: float | None
    prior_rmse: float | None
    vehicle_file_rmse: float | None
    constant_velocity_rmse: float | None
    expected_rmse: float | None = None
    share_within_band: float | None = None
    draws: int | None = None
    draws_blown_up: int | None = None
    independent: float | None = None


class ManoeuvreNumber(NamedTuple):
    """A row of ``manoeuvres.csv``: a number by which manoeuvres are known, SI; speeds as the DVL reads them.

    Attributes
    ----------
    manoeuvre : str
        ``zigzag 20`` (rudder in degrees) or ``turning circle 15``.
    number : str
        For example ``overshoot 1`` or ``radius``.
    time_s : float
        Where it begins: the rudder's reversal, or the beginning of the steady turn.
    unit : str
    measured : float
    predicted : float or None
        By the free run; None where that is not finite.
    """

    manoeuvre: str
    number: str
    time_s: float
    unit: str
    measured: float
    predicted: float | None


class Validation(NamedTuple):
    """Predictions and verdicts of an estimate on other data.

    Attributes
    ----------
    filter : str
    judgement : Judgement
        Of the estimate, by itself.
    predictions : list of Prediction
        Those of the free run, then by horizon.
    manoeuvres : list of ManoeuvreNumber
    checks : Checks
    shown : Dataset
        The longest segment of the data.
    run : FreeRun
        Of the identified model there, as the sensors read it, see `FreeRunFit`.
    remarks : list of str
        Sentences on what is missing.
    """

    filter: str
    judgement: "Judgement"
    predictions: list[Prediction]
    manoeuvres: list[ManoeuvreNumber]
    checks: Checks
    shown: Dataset
    run: FreeRun
    remarks: list[str]

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
        """Name signals whose measurements are nearer to their own mean than to a prediction of a kind."""
        fits = ((row.signal, row.fit_percent) for row in self.predictions if row.kind == kind)
        return list(dict.fromkeys(signal for signal, fit in fits if fit is not None and fit < 0.0))
