"""What is said of a model on data that it has not seen: the value objects, apart from the compiled code."""

from typing import TYPE_CHECKING, NamedTuple

from auvid_cli.data.check import Check, Checks
from auvid_cli.data.dataset import Dataset
from auvid_cli.data.named_rows import NamedRows, frames
from auvid_cli.evaluation.predicted_motion import FreeRun

if TYPE_CHECKING:
    import pandas as pd

    from auvid_cli.evaluation.judgement import Judgement

FREE_RUN, AHEAD = "free_run", "ahead"
# The check that a model fails which is better than it says.
NO_WIDER = "no wider than its errors"


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
        Of how many independent errors those of all starts say as much, see `auvid_cli.validation.independence`.
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
