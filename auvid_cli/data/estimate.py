"""What a filter found: the value object between identification and evaluation."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from auvid_cli.config.experiment import Experiment
from auvid_cli.vehicle.parameters import MOTION_SYMBOLS

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Innovations:
    """One sensor's innovations.

    Attributes
    ----------
    time : ndarray, shape (k,)
    innovation, variance : ndarray, shape (k, c)
        SI; NaN where a component was missing or the filter had ended.
    nis : ndarray, shape (k,)
        Normalised innovation squared.
    standard_deviation : ndarray, shape (c,)
        Of the measurement noise, as the filter was told.
    """

    time: Array
    innovation: Array
    variance: Array
    nis: Array
    standard_deviation: Array


@dataclass(frozen=True)
class Estimate:
    """Augmented state over time, of one filter.

    Attributes
    ----------
    filter : str
        "ekf", "ckf", "tukf" or "ukf".
    experiment : Experiment
        Settings it was made with.
    state : tuple of str
        Symbols: the estimated coefficients, then the nine motion states.
    unit : tuple of str
    time : ndarray, shape (n,)
        s, after each event; ends early where the filter diverged.
    mean, standard_deviation : ndarray, shape (n, len(state))
        SI.
    covariance : ndarray, shape (len(state), len(state))
        At the last time.
    innovations : dict of Innovations
        By sensor.
    held : dict
        Coefficients that were not estimated, SI.
    status : str
        "completed", or "diverged at t = ...: why".
    cpu_time, wall_time : float
        Of the filter alone, s.
    dataset_sha256 : str
        Of the dataset it came from.
    """

    filter: str
    experiment: Experiment
    state: tuple[str, ...]
    unit: tuple[str, ...]
    time: Array
    mean: Array
    standard_deviation: Array
    covariance: Array
    innovations: dict[str, Innovations]
    held: dict[str, float]
    status: str
    cpu_time: float
    wall_time: float
    dataset_sha256: str = ""

    @property
    def completed(self) -> bool:
        """Whether the filter reached the end of the data."""
        return self.status == "completed"

    def final_coefficients(self) -> dict[str, float]:
        """The 22 coefficients at the last time, estimated or held, SI."""
        return self.held | {
            symbol: float(self.mean[-1, i]) for i, symbol in enumerate(self.state) if symbol not in MOTION_SYMBOLS
        }
