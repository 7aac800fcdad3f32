"""What a search may vary, all of it physical: turn, pitch, stiffness of the autopilot, size and band of each signal."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.config.experiment import Experiment
from auvid_cli.config.manoeuvre import AnyManoeuvre, Autopilot, Doublets, Envelope, Excitation, Spiral, Zigzag
from auvid_cli.errors import ConfigError
from auvid_cli.vehicle.parameters import INPUT_SYMBOLS

Array = NDArray[np.float64]

_SHORTEST = 20.0
# A fin signal may be larger than the fins allow: it is then cut, which tells more of a slow vehicle.
_OVER_THE_LIMIT = 1.7
_LARGEST_THRUST, _LARGEST_PITCH = 0.5, 0.8
# Times speed by length: turn rate, rad/s, and frequencies, Hz.
_FASTEST_TURN, _LARGEST_LOWEST, _HIGHEST = 0.3, 0.2, 0.8
_BANDWIDTHS = 0.2, 3.0
_LINES, _DIGITS = 9, 6


class Variable(NamedTuple):
    """One of them, SI.

    Attributes
    ----------
    name : str
        Path in the manoeuvre's settings.
    low, high : float
    by_ratio : bool
        Whether equal steps are equal ratios.
    """

    name: str
    low: float
    high: float
    by_ratio: bool = False

    def at(self, place: float) -> float:
        """Return its value at a place from 0 to 1."""
        if self.by_ratio:
            value = self.low * (self.high / self.low) ** place
        else:
            value = self.low + (self.high - self.low) * place
        # A crew reads it, and settings take nothing that is almost 0.
        return round(float(value), _DIGITS)

    def place_of(self, value: float) -> float:
        """Return the nearest place of a value."""
        if self.high <= self.low:
            return 0.0
        if self.by_ratio:
            place = np.log(max(value, self.low) / self.low) / np.log(self.high / self.low)
        else:
            place = (value - self.low) / (self.high - self.low)
        return float(np.clip(place, 0.0, 1.0))


class SearchSpace(NamedTuple):
    """Manoeuvres about one: what varies, and what stays.

    Attributes
    ----------
    base : Spiral
        The experiment's own, with the duration and the fins of the design.
    variables : tuple of Variable
    """

    base: Spiral
    variables: tuple[Variable, ...]

    def manoeuvre(self, places: Array) -> Spiral:
        """Make the manoeuvre of a point of the unit cube."""
        at = {v.name: v.at(place) for v, place in zip(self.variables, places, strict=True)}
        channels = self._channels()
        narrowest = len(channels) / self.base.duration + 10.0**-_DIGITS
        excitation = dict[str, object]()
        for name in channels:
            lowest = at[f"{name}.lowest"]
            highest = round(max(at[f"{name}.highest"], lowest + narrowest), _DIGITS)
            settings = {"amplitude": at[f"{name}.amplitude"], "lowest": lowest, "highest": highest, "lines": _LINES}
            excitation[name] = settings
        settings = {"fade_in": self.base.excitation.fade_in, "orthogonal": True, **excitation}
        changes = {
            "name": "designed",
            "turn_rate": at["turn_rate"],
            "pitch": at["pitch"],
            "autopilot": Autopilot(bandwidth=at["bandwidth"]),
            "excitation": Excitation.model_validate(settings),
        }
        return self.base.model_copy(update=changes)

    def start(self) -> Array:
        """Return the point nearest to the manoeuvre that all is about."""
        base, values = self.base, dict[str, float]()
        values |= {"turn_rate": base.turn_rate, "pitch": base.pitch, "bandwidth": base.autopilot.bandwidth}
        for name, channel in zip(INPUT_SYMBOLS, base.excitation.channels(), strict=True):
            if channel is not None:
                values |= {f"{name}.{field}": getattr(channel, field) for field in ("amplitude", "lowest", "highest")}
        return np.array([v.place_of(values[v.name]) if v.name in values else 0.5 for v in self.variables])

    def _channels(self) -> list[str]:
        return [name for name in INPUT_SYMBOLS if any(v.name.startswith(f"{name}.") for v in self.variables)]


def baseline_spiral(experiment: Experiment, duration: float, fin_angle: float | None, fin_rate: float | None) -> Spiral:
    """Return the spiral of an experiment, as long as the design and with its fins.

    Raises
    ------
    ConfigError
        If it is none, or too short.
    """
    manoeuvre = experiment.manoeuvre
    if not isinstance(manoeuvre, Spiral):
        raise ConfigError(
            f"a design begins with a spiral and is compared with it, and the manoeuvre is of type {manoeuvre.type}: "
            "--set manoeuvre=manoeuvres/spiral_remus100.yaml, or the like of the vehicle's own speed"
        )
    if duration < _SHORTEST:
        raise ConfigError(f"--duration {duration:g} s: expected at least {_SHORTEST:g} s")
    changed = {"fin_angle": fin_angle, "fin_rate": fin_rate}
    limits = manoeuvre.limits.model_copy(update={name: value for name, value in changed.items() if value is not None})
    # No more is asked of the fins and the propeller than the vehicle file says they do.
    fins, _, propeller = experiment.vehicle.actuators.actuators()
    able = {
        "fin_angle": min(limits.fin_angle, fins.saturation),
        "fin_rate": min(limits.fin_rate, fins.rate_limit),
        "surge_force": min(limits.surge_force, propeller.saturation),
    }
    limits = limits.model_copy(update=able)
    # Half of a short run for its start would tell nothing.
    fade_in = min(manoeuvre.excitation.fade_in, 0.25 * duration)
    excitation = manoeuvre.excitation.model_copy(update={"fade_in": fade_in})
    return manoeuvre.model_copy(update={"duration": duration, "limits": limits, "excitation": excitation})


def search_space(own: Spiral, length: float, drag: float, envelope: Envelope) -> SearchSpace:
    """Return what may vary.

    Parameters
    ----------
    own : Spiral
    length : float
        Of the hull, m.
    drag : float
        By the square of the speed, kg/m: what the thrust is at cruise follows from it.
    envelope : Envelope
    """
    pace, thrust = own.speed / length, drag * own.speed**2
    pitch = _LARGEST_PITCH * envelope.pitch
    roll = own.excitation.roll_moment
    surge = own.excitation.surge_force
    fins = _OVER_THE_LIMIT * own.limits.fin_angle
    amplitudes = {
        "rudder": fins,
        "elevator": fins,
        "surge_force": max(_LARGEST_THRUST * thrust, surge.amplitude if surge else 0.0),
        # Only a vehicle that can roll by itself is asked to.
        "roll_moment": roll.amplitude if roll else 0.0,
    }
    lowest = 2.0 / own.duration
    bands = [
        variable
        for name, amplitude in amplitudes.items()
        if amplitude > 0.0
        for variable in (
            Variable(f"{name}.amplitude", 0.0, amplitude),
            Variable(f"{name}.lowest", lowest, max(_LARGEST_LOWEST * pace, 2.0 * lowest), by_ratio=True),
            Variable(f"{name}.highest", 2.0 * lowest, max(_HIGHEST * pace, 4.0 * lowest), by_ratio=True),
        )
    ]
    return SearchSpace(
        own,
        (
            Variable("turn_rate", 0.0, _FASTEST_TURN * pace),
            Variable("pitch", -pitch, pitch),
            Variable("bandwidth", *_BANDWIDTHS, by_ratio=True),
            *bands,
        ),
    )


def standard_manoeuvres(own: Spiral, length: float) -> dict[str, AnyManoeuvre]:
    """Return what is usually sailed, as long and with the same fins: 3-2-1-1 doublets and a zigzag."""
    same = {"duration": own.duration, "speed": own.speed, "limits": own.limits}
    angle = min(own.limits.fin_angle, np.deg2rad(20.0))
    step = min(own.limits.fin_angle, np.deg2rad(8.0))
    # Of the shipped doublets, at the pace of this vehicle.
    unit = 1.8 * length / own.speed
    doublets = Doublets(type="doublets", name="3-2-1-1", rudder=step, elevator=0.75 * step, unit_time=unit, **same)
    zigzag = Zigzag(type="zigzag", name="zigzag", rudder=angle, heading=float(np.deg2rad(20.0)), **same)
    return {"doublets": doublets, "zigzag": zigzag}
