"""Agreement of sensors that measure the same motion, pitch offset, and units that may have been mistaken."""

from collections.abc import Mapping
from math import log
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.data.checks import Check
from auvid_cli.data.dataset import SensorRecord
from auvid_cli.data.signals import rate_noise
from auvid_cli.inspection.inspection import cannot_tell, judged
from auvid_cli.inspection.kinematic_relations import (
    Regression,
    Relation,
    Signals,
    attitude_rates,
    attitude_window,
    fit,
    measured_depth_rate,
    regress_relation,
    smoothed,
    without_mean,
)
from auvid_cli.inspection.responses import AXES, RotationAxis, answers, response_check, response_fits, sideslip
from auvid_cli.inspection.single_sensor import ENOUGH_FOR_NOISE, continuous, noise_floor
from auvid_cli.vehicle.kinematics import GRAVITY
from auvid_cli.vehicle.parameters import SENSORS

# How much a unit is in SI units, turned over: the factor by which numbers in it are too large.
_FACTORS = {
    "m": {"feet": 1.0 / 0.3048, "mm": 1000.0, "cm": 100.0},
    "m/s": {"knots": 3600.0 / 1852.0, "ft/s": 1.0 / 0.3048, "km/h": 3.6, "mm/s": 1000.0, "cm/s": 100.0},
    "m/s^2": {"g": 1.0 / GRAVITY, "mg": 1000.0 / GRAVITY},
    "rad": {"degrees": 57.29577951308232, "mrad": 1000.0},
    "rad/s": {"deg/s": 57.29577951308232, "rad/min": 60.0, "revolutions per minute": 9.549296585513721},
}
_NEAR = log(1.1)
_TOLERANCE = 0.2
_LEAST_CORRELATION = 0.7
# rad/s, of a rate that attitude shows.
_LEAST_SPREAD = np.deg2rad(0.3)
_SIGMAS = 3.0
# How many times what the noise of an angle makes of it a rate must be for that not to hide it.
_TIMES_NOISE = 3.0
_THRESHOLD = f"gain 1 +- {_TOLERANCE}, correlation >= {_LEAST_CORRELATION}"
Array = NDArray[np.float64]
_USUAL, _LARGEST = np.deg2rad(2.0), np.deg2rad(5.0)
# s, of an interval of the run, at least; and how many intervals there are at most.
_INTERVAL, _MOST_INTERVALS = 10.0, 1000
# Intervals in a row that an offset lasts, so that it is one.
_FEWEST_IN_A_ROW = 2
# Share of the usual speed at which the vehicle goes where its nose points.
_AHEAD = 0.5
_ROUNDS = 4


def mistaken_unit(symbol: str, unit: str, times: float) -> str:
    """Name the unit that explains why a signal is so many times too large; empty if no usual one does.

    Parameters
    ----------
    symbol : str
    unit : str
        SI unit for which it was taken.
    times : float
        Positive.
    """
    candidates = []
    for name, factor in _FACTORS[unit].items():
        candidates.append((abs(log(times / factor)), f"{symbol} is in {name}, taken for {unit}."))
        candidates.append(
            (abs(log(times * factor)), f"{symbol} was in {unit} and was converted as if it were in {name}.")
        )
    nearest, words = min(candidates)
    return words if nearest < _NEAR else ""


def mistaken_units(factor: float, above: tuple[str, str], below: tuple[str, str]) -> str:
    """Do the same where a gain may be that of either of two signals, each a symbol and its SI unit, or of both."""
    if factor == 0.0:
        return ""
    size = abs(factor)
    return " Or: ".join(words for words in (mistaken_unit(*above, size), mistaken_unit(*below, 1.0 / size)) if words)


def rotation_checks(signals: Signals, sensors: Mapping[str, SensorRecord], time_constant: float | None) -> list[Check]:
    """Judge rates against angles about each axis, and the answer to each moment.

    Parameters
    ----------
    signals : Signals
    sensors : mapping of str to SensorRecord
        What they are made of.
    time_constant : float or None
        s, of the vehicle, if it is known.
    """
    checks = []
    for axis in AXES:
        fits = response_fits(signals, axis, time_constant)
        for angle, subject in ((axis.angle, "attitude"), *([("heading", "magnetometer")] if axis.rate == "r" else [])):
            relation = attitude_rates(signals, "heading" if angle == "heading" else "psi").get(axis.rate)
            if relation is not None and signals.has(axis.rate):
                window = signals.window(axis.rate, angle)
                fitted = regress_relation(signals.values[axis.rate], relation.main, relation.others, window)
                noise = _noise_of_rate(signals, sensors, angle, window)
                checks.append(_agreement(axis, angle, subject, fitted, noise, _votes(signals, axis, fits)))
            elif signals.has(axis.rate) or signals.has(angle):
                lacking, known = (axis.rate, subject) if signals.has(angle) else (angle, "gyroscope")
                if lacking != "heading":
                    reason = f"{lacking} is not measured"
                    checks.append(cannot_tell(known, f"{axis.rate} against {angle}", reason, _THRESHOLD))
        checks.append(response_check(signals, axis, fits))
    return checks


def _noise_of_rate(signals: Signals, sensors: Mapping[str, SensorRecord], angle: str, window: int) -> float:
    """Return the standard deviation, rad/s, of what noise of an angle makes of its change, averaged over a window."""
    floor, step = _noise_floor(sensors, angle), signals.grid.step
    half = attitude_window(signals, "heading" if angle == "heading" else "psi") // 2
    return floor * float(np.sqrt(signals.interval[angle] / step)) * rate_noise(step, half, window)


def _noise_floor(sensors: Mapping[str, SensorRecord], symbol: str) -> float:
    """Return the scatter of the first sensor of an angle, rad, as far as it is enough to tell."""
    columns = (
        continuous(record.values[:, component], quantity)
        for name, record in sensors.items()
        for component, quantity in enumerate(SENSORS[name])
        if quantity.symbol == symbol
    )
    values = next(columns)
    return noise_floor(values) if values.size > ENOUGH_FOR_NOISE else 0.0


def _votes(signals: Signals, axis: RotationAxis, fits: dict[str, Regression | None]) -> dict[str, tuple[int, ...]]:
    """Return by sensor what speaks for the sign of its rate, 1, or against it, -1: the answer to the fin, the slip."""
    sideways = {"q": "w", "r": "v"}.get(axis.rate)
    told = [answers(axis, fits)]
    if sideways is not None and signals.has("u", sideways):
        told.append({name: 1 if ahead > 0.0 else -1 for name, ahead in sideslip(signals, sideways).items()})
    return {name: tuple(signs[name] for signs in told if name in signs) for name in fits}


def _agreement(
    axis: RotationAxis,
    angle: str,
    other: str,
    fitted: Regression | None,
    noise: float,
    votes: dict[str, tuple[int, ...]],
) -> Check:
    name = f"{axis.rate} against {angle}"
    if fitted is None or fitted.spread < _LEAST_SPREAD or _is_hidden(fitted, noise):
        turning = "too short" if fitted is None else f"{np.rad2deg(fitted.spread):.2g} deg/s"
        if fitted is not None and fitted.spread >= _LEAST_SPREAD:
            turning += f", of which noise of {angle} makes {np.rad2deg(noise):.2g}"
        return judged(
            "gyroscope",
            name,
            statistic=f"not excited enough to tell: {turning}",
            threshold=_THRESHOLD,
            passed=None,
            advice=f"The vehicle hardly turns about this axis: sign and scale of {axis.rate} and {angle} cannot be "
            "checked.",
        )
    statistic = f"gain {fitted.gain:.3g} +- {fitted.error:.2g}, correlation {fitted.correlation:.2g}"
    agrees = fitted.correlation >= _LEAST_CORRELATION and abs(fitted.gain - 1.0) <= _TOLERANCE + _SIGMAS * fitted.error
    # Of two that contradict each other in sign, the one that what the vehicle does contradicts as well.
    by_gyroscope, by_angle = votes.get("gyroscope", ()), votes.get("attitude", ())
    undecided = {*by_gyroscope} == {-1, 1}
    angle_is_wrong = angle == "heading" or (sum(by_angle) < 0 and sum(by_gyroscope) > 0)
    subject = other if fitted.gain < 0.0 and angle_is_wrong and not sum(by_gyroscope) < 0 else "gyroscope"
    return judged(
        subject,
        name,
        statistic=statistic,
        threshold=_THRESHOLD,
        passed=agrees,
        advice=_advice(fitted, axis.rate, angle, "" if undecided else subject),
    )


def _is_hidden(fitted: Regression, noise: float) -> bool:
    """Say whether noise of the angle may be all that makes a gain too small, or hides that the two belong together."""
    by_noise = abs(fitted.correlation) < _LEAST_CORRELATION or 0.0 < fitted.gain < 1.0
    return by_noise and fitted.spread < _TIMES_NOISE * noise


def _advice(fitted: Regression, rate: str, angle: str, subject: str) -> str:
    if abs(fitted.correlation) < _LEAST_CORRELATION:
        return (
            f"{rate} and {angle} do not belong together: axes are exchanged, one of them is delayed or smoothed, or it "
            "does not measure."
        )
    advice = []
    if fitted.gain < 0.0 and not subject:
        advice.append(
            f"The sign of {rate} or that of {angle} is turned. The fin speaks for one and the slip in turns for the "
            "other, so that another sign is turned, too: only what the makers say of their frames tells the vehicle "
            "from its mirror image."
        )
    elif fitted.gain < 0.0:
        wrong = rate if subject == "gyroscope" else angle
        advice.append(
            f"The sign of {wrong} is turned, or its axes are those of another frame (x forward, y starboard, z down)."
        )
    size = abs(fitted.gain)
    if abs(size - 1.0) > _TOLERANCE:
        advice.append(
            mistaken_units(size, (rate, "rad/s"), (angle, "rad"))
            or f"{rate} is {size:.3g} times what {angle} says: look at units and scales, and whether one axis is meant."
        )
    return " ".join(advice) or "Do not use both before it is clear which is right."


class PitchOffset(NamedTuple):
    """Offset of theta.

    Attributes
    ----------
    usual : float
        Median over intervals of the run, rad.
    away : float or None
        Where it is too large for a while only: its median over that time, rad; `span` is the longest such time, s, and
        `rest` the median of the others.
    span : tuple of float or None
    rest : float or None
    """

    usual: float
    away: float | None = None
    span: tuple[float, float] | None = None
    rest: float | None = None

    @property
    def largest(self) -> float:
        """Return the one to judge by, rad."""
        return self.usual if self.away is None else self.away

    @property
    def is_too_large(self) -> bool:
        """Say whether it fails."""
        return abs(self.largest) > _LARGEST


def ahead(signals: Signals) -> NDArray[np.bool_]:
    """Say where the vehicle makes way, so that the depth that it gains tells its pitch."""
    u = signals.values["u"]
    return u >= _AHEAD * np.nanquantile(u, 0.9)


def offset_by_depth(signals: Signals, dive: Relation) -> PitchOffset | None:
    """Find it by the depth rate that pitch and speed do not explain; None if the vehicle hardly makes way."""
    lacking = measured_depth_rate(signals) - dive.total()
    return _offset(signals, np.where(ahead(signals), lacking, np.nan), signals.values["u"])


def offset_by_gravity(signals: Signals, forward: Relation) -> PitchOffset | None:
    """Find it by what the accelerometer feels forwards."""
    lacking = signals.values["fx"] - forward.total()
    return _offset(signals, lacking, np.full(lacking.size, -GRAVITY))


def fit_over_seconds(signals: Signals, dive: Relation) -> Regression | None:
    """Regress the depth rate on pitch and surge, both without what changes slower than within seconds.

    An offset that comes and goes spoils the gain over the whole run, and leaves this one alone.
    """
    window, interval = signals.window("down", "u", "theta"), round(_INTERVAL / signals.grid.step)
    moving = np.where(ahead(signals), 0.0, np.nan)
    within = [
        without_mean(smoothed(each, window), interval)
        for each in (measured_depth_rate(signals) + moving, dive.main, *dive.others)
    ]
    return fit(within[0], within[1], within[2:], window)


def _offset(signals: Signals, lacking: Array, weight: Array) -> PitchOffset | None:
    """Solve `lacking` = `weight` (sin(theta) - sin(theta - offset)), interval by interval."""
    grid, theta = signals.grid, signals.values["theta"]
    finite = np.isfinite(lacking) & np.isfinite(weight) & np.isfinite(theta)
    length = max(round(_INTERVAL / grid.step), -(-grid.cells // _MOST_INTERVALS))
    starts, offsets = [], []
    for start in range(0, grid.cells, length):
        interval = slice(start, start + length)
        inside = finite[interval]
        # An interval that is hardly known says little, unless there is no other.
        if inside.sum() >= 0.5 * min(length, grid.cells):
            starts.append(start)
            offsets.append(
                _offset_of_interval(lacking[interval][inside], weight[interval][inside], theta[interval][inside])
            )
    if not offsets:
        return None
    by_interval = np.array(offsets)
    usual = float(np.median(by_interval))
    first, end = _longest_run(np.where(np.abs(by_interval) > _LARGEST, np.sign(by_interval), 0.0))
    if end - first < _FEWEST_IN_A_ROW or end - first == by_interval.size:
        return PitchOffset(usual)
    span = grid.start + grid.step * starts[first], grid.start + grid.step * min(starts[end - 1] + length, grid.cells)
    rest = np.delete(by_interval, slice(first, end))
    return PitchOffset(usual, float(np.median(by_interval[first:end])), span, float(np.median(rest)))


def _offset_of_interval(lacking: Array, weight: Array, theta: Array) -> float:
    # Where a sensor errs now and then the median does not follow.
    missing, offset = float(np.median(lacking)), 0.0
    for _ in range(_ROUNDS):
        # sin(theta) - sin(theta - offset) = 2 sin(offset / 2) cos(theta - offset / 2)
        offset = missing / float(np.mean(weight * np.cos(theta - 0.5 * offset)))
    return offset


def _longest_run(signs: Array) -> tuple[int, int]:
    """Find first and one past the last of the longest run of one sign that is not 0; both 0 if there is none."""
    edges = np.flatnonzero(np.diff(signs, prepend=np.nan, append=np.nan))
    runs = [(a, b) for a, b in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True) if signs[a]]
    return max(runs, key=lambda run: run[1] - run[0], default=(0, 0))


def pitch_offset_check(offset: PitchOffset, witness: str) -> Check:
    """Judge how far theta is off; `witness` says by what."""
    size = abs(offset.largest)
    when = ""
    if offset.span is not None and offset.rest is not None:
        start, end = offset.span
        when = f" from t = {start:.4g} to {end:.4g} s, {np.rad2deg(offset.rest):+.2g} deg in the rest"
    return judged(
        "attitude",
        "pitch offset",
        statistic=f"theta is {np.rad2deg(offset.largest):+.2g} deg off by the {witness}{when}",
        threshold=f"<= {np.rad2deg(_USUAL):.2g} deg; fails beyond {np.rad2deg(_LARGEST):.2g} deg",
        passed=True if size <= _USUAL else None if size <= _LARGEST else False,
        advice="The pitch of this source is wrong for a part of the run: use another source, or identify from the rest "
        "(`--use`)."
        if when
        else "The unit that measures theta, or the one that measures velocity, is mounted at an angle: take this off "
        "theta (or turn u and w by it).",
    )
