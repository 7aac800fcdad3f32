"""Where vehicles as they may be go under one manoeuvre: the middle of them, and within what most of them stay."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.design.envelope import extent_of
from auvid_cli.errors import DataError

if TYPE_CHECKING:
    # Figures know a band, and load nothing that is compiled.
    from auvid_cli.simulation.true_motion import Truth

Array = NDArray[np.float64]

LOW, HIGH = 5.0, 95.0


class Band(NamedTuple):
    """What is seen of a run, over time; the last axis is low, middle, high: 5, 50 and 95 of 100 vehicles.

    Attributes
    ----------
    time : ndarray, shape (n,)
        s, one a second.
    position : ndarray, shape (n, 3, 3)
        North, east, down, m, from the start.
    turned, turn_rate, pitch, roll, speed : ndarray, shape (n, 3)
        Change of heading (rad), rad/s, rad, rad, m/s.
    box : tuple of float
        Which 95 of 100 vehicles stay within: north, east, m.
    depths : tuple of float
        Shallowest and deepest of 95 of 100 vehicles, m from the start, down.
    length, energy : tuple of float
        Way through the water, m, and work of the thrust, J, of 5 and of 95 of 100 vehicles.
    number : int
        Of the vehicles.
    """

    time: Array
    position: Array
    turned: Array
    turn_rate: Array
    pitch: Array
    roll: Array
    speed: Array
    box: tuple[float, float]
    depths: tuple[float, float]
    length: tuple[float, float]
    energy: tuple[float, float]
    number: int


def band_of(runs: Sequence["Truth"]) -> Band:
    """Summarise runs of one manoeuvre.

    Raises
    ------
    DataError
        If there is none.
    """
    if not runs:
        raise DataError("every vehicle that was drawn for the track is lost; draw them nearer to each other (--spread)")
    time = np.arange(0.0, runs[0].time[-1] + 1e-9, 1.0)
    places = np.searchsorted(runs[0].time, time - 1e-9)
    motion, position = np.array([run.motion[places] for run in runs]), np.array([run.position[places] for run in runs])
    extent = np.array([np.ptp(run.position[:, :2], axis=0) for run in runs])
    depths = np.array([(run.position[:, 2].min(), run.position[:, 2].max()) for run in runs])
    lengths = [float(np.linalg.norm(np.diff(run.position, axis=0), axis=1).sum()) for run in runs]
    energies = [extent_of(run, 0.0).energy for run in runs]

    def spread(values: Array) -> Array:
        return np.moveaxis(np.percentile(values, [LOW, 50.0, HIGH], axis=0), 0, -1)

    def outer(values: Sequence[float]) -> tuple[float, float]:
        low, high = np.percentile(values, [LOW, HIGH])
        return float(low), float(high)

    columns = {"turned": 8, "turn_rate": 5, "pitch": 7, "roll": 6, "speed": 0}
    north, east = np.percentile(extent, HIGH, axis=0)
    shallowest, deepest = np.percentile(depths[:, 0], LOW), np.percentile(depths[:, 1], HIGH)
    return Band(
        time,
        spread(position),
        **{name: spread(motion[:, :, column]) for name, column in columns.items()},
        box=(float(north), float(east)),
        depths=(float(shallowest), float(deepest)),
        length=outer(lengths),
        energy=outer(energies),
        number=len(runs),
    )
