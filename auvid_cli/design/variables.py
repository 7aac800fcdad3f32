"""Variables of a search: turn rate, pitch, bandwidth of the autopilot, amplitude and band of each signal."""

from typing import NamedTuple

import numpy as np

from auvid_cli.arrays import Array
from auvid_cli.config.experiment import Experiment
from auvid_cli.config.manoeuvre import AnyManoeuvre, Autopilot, Doublets, Envelope, Excitation, Spiral, Zigzag
from auvid_cli.errors import ConfigError
from auvid_cli.vehicle.parameters import INPUT_SYMBOLS

_MIN_DURATION = 20.0  # s
# A fin signal may exceed the fin limit; a slow vehicle is then excited more by the clipped signal.
_MAX_FIN_RATIO = 1.7  # amplitude relative to the limit of the fin
_MAX_THRUST_RATIO = 0.5  # amplitude relative to the thrust at cruise
_MAX_PITCH_RATIO = 0.8  # pitch as a share of the limit of the envelope
# Relative to speed divided by length.
_MAX_TURN_RATE = 0.3  # rad
_MAX_LOWEST = 0.2
_MAX_HIGHEST = 0.8
_BANDWIDTHS = (0.2, 3.0)
_LINES = 9  # spectral lines of each signal
_DIGITS = 6


class Variable(NamedTuple):
    """A setting that varies within bounds, SI."""

    name: str  # path in the manoeuvre's settings
    low: float
    high: float
    logarithmic: bool = False  # whether equal steps are equal ratios

    def at(self, place: float) -> float:
        """Return the value at a place from 0 (`low`) to 1 (`high`)."""
        if self.logarithmic:
            value = self.low * (self.high / self.low) ** place
        else:
            value = self.low + (self.high - self.low) * place
        # Rounded, because the settings reject tiny numbers that are not 0.
        return round(float(value), _DIGITS)

    def place_of(self, value: float) -> float:
        """Return the place of the nearest value within the bounds."""
        if self.high <= self.low:
            return 0.0
        if self.logarithmic:
            place = np.log(max(value, self.low) / self.low) / np.log(self.high / self.low)
        else:
            place = (value - self.low) / (self.high - self.low)
        return float(np.clip(place, 0.0, 1.0))


class SearchSpace(NamedTuple):
    """Spirals around a base that differ in some variables."""

    base: Spiral  # the experiment's own, with the duration and the fin limits of the design
    variables: tuple[Variable, ...]

    def manoeuvre(self, places: Array) -> Spiral:
        """Return the manoeuvre at a point of the unit cube, shape (n,)."""
        at = {v.name: v.at(place) for v, place in zip(self.variables, places, strict=True)}
        channels = [name for name in INPUT_SYMBOLS if f"{name}.lowest" in at]
        narrowest = len(channels) / self.base.duration + 10.0**-_DIGITS
        excitation = dict[str, object]()
        for name in channels:
            lowest = at[f"{name}.lowest"]
            highest = round(max(at[f"{name}.highest"], lowest + narrowest), _DIGITS)
            amplitude = at[f"{name}.amplitude"]
            excitation[name] = {"amplitude": amplitude, "lowest": lowest, "highest": highest, "lines": _LINES}
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
        """Return the point of the unit cube nearest to the base."""
        base, values = self.base, dict[str, float]()
        values |= {"turn_rate": base.turn_rate, "pitch": base.pitch, "bandwidth": base.autopilot.bandwidth}
        for name, channel in zip(INPUT_SYMBOLS, base.excitation.channels(), strict=True):
            if channel is not None:
                values |= {f"{name}.{field}": getattr(channel, field) for field in ("amplitude", "lowest", "highest")}
        return np.array([v.place_of(values[v.name]) if v.name in values else 0.5 for v in self.variables])


def baseline_spiral(experiment: Experiment, duration: float, fin_angle: float | None, fin_rate: float | None) -> Spiral:
    """Return the spiral of an experiment with the duration, s, and fin limits, rad and rad/s, of the design.

    Raises
    ------
    ConfigError
        If the manoeuvre is not a spiral, or too short.
    """
    manoeuvre = experiment.manoeuvre
    if not isinstance(manoeuvre, Spiral):
        raise ConfigError(
            f"manoeuvre: type {manoeuvre.type}; expected a spiral, with which a design begins and is compared: "
            "--set manoeuvre=manoeuvres/spiral_remus100.yaml, or a similar one with the vehicle's own speed"
        )
    if duration < _MIN_DURATION:
        raise ConfigError(f"--duration {duration:g} s: expected at least {_MIN_DURATION:g} s")
    changed = {"fin_angle": fin_angle, "fin_rate": fin_rate}
    limits = manoeuvre.limits.model_copy(update={name: value for name, value in changed.items() if value is not None})
    # The manoeuvre keeps the limits of the vehicle's fins and propeller.
    fins, _, propeller = experiment.vehicle.actuators.actuators()
    feasible = {
        "fin_angle": min(limits.fin_angle, fins.saturation),
        "fin_rate": min(limits.fin_rate, fins.rate_limit),
        "surge_force": min(limits.surge_force, propeller.saturation),
    }
    limits = limits.model_copy(update=feasible)
    # A long fade-in would leave too little of a short run.
    fade_in = min(manoeuvre.excitation.fade_in, 0.25 * duration)
    excitation = manoeuvre.excitation.model_copy(update={"fade_in": fade_in})
    return manoeuvre.model_copy(update={"duration": duration, "limits": limits, "excitation": excitation})


def search_space(own: Spiral, length: float, drag: float, envelope: Envelope) -> SearchSpace:
    """Return the search space around a spiral.

    Parameters
    ----------
    length : float
        Length of the hull, m.
    drag : float
        Drag divided by the square of the speed, kg/m, for the thrust at cruise.
    """
    pace, thrust = own.speed / length, drag * own.speed**2
    pitch = _MAX_PITCH_RATIO * envelope.pitch
    roll = own.excitation.roll_moment
    surge = own.excitation.surge_force
    fins = _MAX_FIN_RATIO * own.limits.fin_angle
    amplitudes = {
        "rudder": fins,
        "elevator": fins,
        "surge_force": max(_MAX_THRUST_RATIO * thrust, surge.amplitude if surge else 0.0),
        # Only a spiral that excites roll shows that the vehicle can.
        "roll_moment": roll.amplitude if roll else 0.0,
    }
    lowest = 2.0 / own.duration
    bands = [
        variable
        for name, amplitude in amplitudes.items()
        if amplitude > 0.0
        for variable in (
            Variable(f"{name}.amplitude", 0.0, amplitude),
            Variable(f"{name}.lowest", lowest, max(_MAX_LOWEST * pace, 2.0 * lowest), logarithmic=True),
            Variable(f"{name}.highest", 2.0 * lowest, max(_MAX_HIGHEST * pace, 4.0 * lowest), logarithmic=True),
        )
    ]
    return SearchSpace(
        own,
        (
            Variable("turn_rate", 0.0, _MAX_TURN_RATE * pace),
            Variable("pitch", -pitch, pitch),
            Variable("bandwidth", *_BANDWIDTHS, logarithmic=True),
            *bands,
        ),
    )


def standard_manoeuvres(own: Spiral, length: float) -> dict[str, AnyManoeuvre]:
    """Return 3-2-1-1 doublets and a zigzag with the same duration, speed and fin limits."""
    same = {"duration": own.duration, "speed": own.speed, "limits": own.limits}
    angle = min(own.limits.fin_angle, np.deg2rad(20.0))
    step = min(own.limits.fin_angle, np.deg2rad(8.0))
    # The pace of the shipped doublets, scaled to this vehicle.
    unit = 1.8 * length / own.speed
    doublets = Doublets(type="doublets", name="3-2-1-1", rudder=step, elevator=0.75 * step, unit_time=unit, **same)
    zigzag = Zigzag(type="zigzag", name="zigzag", rudder=angle, heading=float(np.deg2rad(20.0)), **same)
    return {"doublets": doublets, "zigzag": zigzag}
