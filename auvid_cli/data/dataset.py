"""What was commanded and what was measured: the value object between simulation and identification."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from auvid_cli.config.experiment import RunSettings

Array = NDArray[np.float64]


@dataclass(frozen=True)
class SensorRecord:
    """One sensor's samples.

    Attributes
    ----------
    time : ndarray, shape (n,)
        s, increasing.
    values : ndarray, shape (n, c)
        SI; NaN where a component is missing or not valid.
    standard_deviation : ndarray, shape (c,)
        Stated measurement noise, SI.
    """

    time: Array
    values: Array
    standard_deviation: Array


@dataclass(frozen=True)
class InputRecord:
    """Inputs, constant from each time to the next: rudder, elevator, surge force, roll moment."""

    time: Array
    values: Array


@dataclass(frozen=True)
class TruthRecord:
    """What only a simulation knows.

    Attributes
    ----------
    time : ndarray, shape (n,)
    motion : ndarray, shape (n, 9)
    position : ndarray, shape (n, 3)
        North, east, down, m.
    coefficients : dict
        True coefficients by symbol, SI.
    """

    time: Array
    motion: Array
    position: Array
    coefficients: dict[str, float]


@dataclass(frozen=True)
class Dataset:
    """Inputs, sensors and settings of one run; `truth` only where a simulation made it."""

    inputs: InputRecord
    sensors: dict[str, SensorRecord]
    experiment: RunSettings
    truth: TruthRecord | None = None
    sha256: str = ""

    def without_truth(self) -> "Dataset":
        """Return the same as a vehicle would have logged it."""
        return replace(self, truth=None)
