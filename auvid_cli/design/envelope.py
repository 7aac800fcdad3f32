"""Limits of a designed run: room, attitude, speed and energy, and the band that its motion stays in."""

from collections.abc import Sequence
from math import ceil, floor
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.config.manoeuvre import Envelope, ManoeuvreSettings
from auvid_cli.errors import ConfigError, DataError
from auvid_cli.vehicle.parameters import INPUT_SYMBOLS

if TYPE_CHECKING:
    from auvid_cli.simulation.motion import Truth

_SHARE_OF_CRUISE = 0.4
_THRUST = INPUT_SYMBOLS.index("surge_force")
# Vehicles that nobody has drawn yet go a little further.
_MARGIN = 0.05
# Of each limit how it is written, from how many SI units.
_UNITS = {"box": ("m", 1.0), "depth": ("m", 1.0), "pitch": ("deg", np.pi / 180.0), "roll": ("deg", np.pi / 180.0)}
# Of which a run may have so much at most, where there is a limit.
_AT_MOST = "box", "depth", "pitch", "roll", "energy"
Array = NDArray[np.float64]
LOW, HIGH = 5.0, 95.0


class Extent(NamedTuple):
    """What a run took of its envelope, SI; a field for each of its limits."""

    box: float
    depth: float
    pitch: float
    roll: float
    speed: float
    energy: float


_UNITS |= {"speed": ("m/s", 1.0), "energy": ("kJ", 1e3)}


def least_speed(envelope: Envelope, manoeuvre: ManoeuvreSettings) -> float:
    """Return the least speed, m/s.

    Raises
    ------
    ConfigError
        If the cruise itself is no faster.
    """
    if envelope.speed is None:
        return _SHARE_OF_CRUISE * manoeuvre.speed
    if envelope.speed >= manoeuvre.speed:
        raise ConfigError(
            f"the least speed of {envelope.speed:g} m/s is not below the {manoeuvre.speed:g} m/s of the manoeuvre: "
            "lower --speed, or go faster (--set manoeuvre.speed=...)"
        )
    return envelope.speed


def with_margin(envelope: Envelope, slowest: float) -> tuple[Envelope, float]:
    """Return an envelope and a least speed that leave room for vehicles that are not drawn."""
    tighter = {name: (1.0 - _MARGIN) * limit for name, limit in _largest(envelope).items()}
    return envelope.model_copy(update=tighter), (1.0 + _MARGIN) * slowest


def _largest(envelope: Envelope) -> dict[str, float]:
    limits = {name: getattr(envelope, name) for name in _AT_MOST}
    return {name: limit for name, limit in limits.items() if limit is not None}


def measure_extent(truth: "Truth", fade_in: float) -> Extent:
    """Measure a run; its speed once it has begun, and the work of its thrust, whichever way that points."""
    ground = truth.position.max(axis=0) - truth.position.min(axis=0)
    begun = truth.time >= min(fade_in, truth.time[-1])
    return Extent(
        float(ground[:2].max()),
        float(ground[2]),
        float(np.abs(truth.motion[:, 7]).max()),
        float(np.abs(truth.motion[:, 6]).max()),
        float(truth.motion[begun, 0].min()),
        float(np.abs(truth.inputs[:-1, _THRUST] * truth.motion[:-1, 0]) @ np.diff(truth.time)),
    )


def limit_excess(extent: Extent, envelope: Envelope, slowest: float) -> dict[str, float]:
    """Return by what share each limit is passed; 0 where it is kept."""
    shares = {name: getattr(extent, name) / limit - 1.0 for name, limit in _largest(envelope).items()}
    shares["speed"] = 1.0 - extent.speed / slowest
    return {name: max(share, 0.0) for name, share in shares.items()}


def options_to_relax(extents: Sequence[Extent], envelope: Envelope, slowest: float) -> str:
    """Name the options that would let runs pass, with values that do."""
    options = []
    for name, (unit, size) in _UNITS.items():
        if not any(limit_excess(extent, envelope, slowest).get(name) for extent in extents):
            continue
        values = [getattr(extent, name) / size for extent in extents]
        enough = floor(100.0 * min(values)) / 100.0 if name == "speed" else ceil(10.0 * max(values)) / 10.0
        options.append(f"--{name} '{enough:g} {unit}'")
    return ", ".join(options)


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


def summarise_runs(runs: Sequence["Truth"]) -> Band:
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
    energies = [measure_extent(run, 0.0).energy for run in runs]

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
