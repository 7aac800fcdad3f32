"""How far a run goes, and by how much it leaves its envelope."""

from collections.abc import Sequence
from math import ceil, floor
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from auvid_cli.config.envelope import Envelope
from auvid_cli.config.manoeuvre import ManoeuvreSettings
from auvid_cli.errors import ConfigError
from auvid_cli.vehicle.parameters import INPUT_SYMBOLS

# The figures of a mission read a band, and load no compiled code.
if TYPE_CHECKING:
    from auvid_cli.simulation.true_motion import Truth

_SHARE_OF_CRUISE = 0.4
_THRUST = INPUT_SYMBOLS.index("surge_force")


# Vehicles that nobody has drawn yet go a little further.
_MARGIN = 0.05


class Extent(NamedTuple):
    """What a run took of its envelope, SI; a field for each of its limits."""

    box: float
    depth: float
    pitch: float
    roll: float
    speed: float
    energy: float


# Of each limit how it is written, from how many SI units.
_UNITS = {"box": ("m", 1.0), "depth": ("m", 1.0), "pitch": ("deg", np.pi / 180.0), "roll": ("deg", np.pi / 180.0)}
_UNITS |= {"speed": ("m/s", 1.0), "energy": ("kJ", 1e3)}
# Of which a run may have so much at most, where there is a limit.
_AT_MOST = "box", "depth", "pitch", "roll", "energy"


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


def tightened(envelope: Envelope, slowest: float) -> tuple[Envelope, float]:
    """Return an envelope and a least speed that leave room for vehicles that are not drawn."""
    tighter = {name: (1.0 - _MARGIN) * limit for name, limit in _largest(envelope).items()}
    return envelope.model_copy(update=tighter), (1.0 + _MARGIN) * slowest


def _largest(envelope: Envelope) -> dict[str, float]:
    limits = {name: getattr(envelope, name) for name in _AT_MOST}
    return {name: limit for name, limit in limits.items() if limit is not None}


def extent_of(truth: "Truth", fade_in: float) -> Extent:
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


def excess(extent: Extent, envelope: Envelope, slowest: float) -> dict[str, float]:
    """Return by what share each limit is passed; 0 where it is kept."""
    shares = {name: getattr(extent, name) / limit - 1.0 for name, limit in _largest(envelope).items()}
    shares["speed"] = 1.0 - extent.speed / slowest
    return {name: max(share, 0.0) for name, share in shares.items()}


def to_relax(extents: Sequence[Extent], envelope: Envelope, slowest: float) -> str:
    """Name the options that would let runs pass, with values that do."""
    options = []
    for name, (unit, size) in _UNITS.items():
        if not any(excess(extent, envelope, slowest).get(name) for extent in extents):
            continue
        values = [getattr(extent, name) / size for extent in extents]
        enough = floor(100.0 * min(values)) / 100.0 if name == "speed" else ceil(10.0 * max(values)) / 10.0
        options.append(f"--{name} '{enough:g} {unit}'")
    return ", ".join(options)
