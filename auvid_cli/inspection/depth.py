"""Depth against pitch and surge: sign and scale of the depth, scale of the DVL, and pitch offset."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.arrays import Array
from auvid_cli.data.checks import Check
from auvid_cli.inspection.inspection import judged, suggested_units, undetermined
from auvid_cli.inspection.kinematic_relations import (
    Regression,
    Relation,
    Signals,
    change,
    fit,
    mean_between_middles,
    measured_depth_rate,
    regress_relation,
    smoothed,
    without_mean,
)
from auvid_cli.inspection.responses import known_sign
from auvid_cli.vehicle.rigid_body import GRAVITY

MIN_SPREAD = 0.02  # m/s, and m/s^2 against the accelerometer
_GAIN_TOLERANCE = 0.2
_GAIN_SIGMAS = 3.0
_MIN_CORRELATION = 0.7
_SCALE_TIME = 3.0  # s, duration of a change of depth, so long that smoothing and delays hardly matter
_MIN_SCALE_INTERVALS = 10  # samples of depth and pitch in that time; interpolation flattens slower signals
_MAX_SCALE_ERROR = 0.01
_MAX_SCALE_DEVIATION = 0.006  # largest standard error of a known scale
_SCALE_SIGMAS = 2.0
_PITCH_OFFSET_NOTE = np.deg2rad(2.0)
_PITCH_OFFSET_FAILURE = np.deg2rad(5.0)
_PITCH_INTERVAL = 10.0  # s, shortest interval with a pitch offset of its own
_MAX_PITCH_INTERVALS = 1000
_MIN_PITCH_RUN = 2  # successive intervals with the same offset
_AHEAD_SHARE = 0.5  # share of the usual speed from which the vehicle moves where its nose points
_PITCH_ITERATIONS = 4
DEPTH_NAME = "depth against pitch and u"
DEPTH_THRESHOLD = f"gain 1 +- {_GAIN_TOLERANCE}, correlation >= {_MIN_CORRELATION}"


class PitchOffset(NamedTuple):
    """Offset of theta, rad."""

    usual: float  # median over intervals of the run
    temporary: float | None = None  # median over `span` if only this one is too large
    span: tuple[float, float] | None = None  # longest time span with a temporary offset, s
    rest: float | None = None  # median over the rest of the run

    @property
    def largest(self) -> float:
        """Return the offset that the check uses, rad."""
        return self.usual if self.temporary is None else self.temporary

    @property
    def is_too_large(self) -> bool:
        """Whether it fails."""
        return abs(self.largest) > _PITCH_OFFSET_FAILURE


def depth_check(signals: Signals, dive: Relation, offset: PitchOffset | None) -> Check:
    """Check the depth rate against pitch and surge; a pitch offset, even a temporary one, does not fail it."""
    window = signals.window("down", "u", "theta")
    fitted: Regression | None = regress_relation(measured_depth_rate(signals), dive.main, dive.others, window)
    if fitted is None or fitted.spread < MIN_SPREAD:
        advice = (
            "Signs and scales of depth and theta were not checked: the vehicle hardly pitches. In the next log, dive "
            "and climb."
        )
        return undetermined("depth", DEPTH_NAME, "too little excitation", DEPTH_THRESHOLD, advice)
    agrees, source = fitted.correlation >= _MIN_CORRELATION and _is_one(fitted), ""
    if not agrees and offset is not None and offset.is_too_large:
        fast = _fast_depth_rate(signals, dive)
        if fast is not None and known_sign(fast) > 0 and _is_one(fast):
            fitted, agrees, source = fast, True, ", from changes within seconds"
    return judged(
        "depth",
        DEPTH_NAME,
        statistic=f"gain {fitted.gain:.3g} +- {fitted.error:.2g}, correlation {fitted.correlation:.2g}{source}",
        threshold=DEPTH_THRESHOLD,
        passed=agrees,
        advice="The vehicle does not move where its nose points. Check in the map: depth positive down and in m, theta "
        f"positive nose up, and a delay of one of them.{suggested_units(fitted.gain, ('depth', 'm'), ('u', 'm/s'))}",
    )


def _fast_depth_rate(signals: Signals, dive: Relation) -> Regression | None:
    """Return the regression of the depth rate on pitch and surge, all without slow changes.

    A temporary pitch offset distorts the gain over the whole run, but not this one.
    """
    window, interval = signals.window("down", "u", "theta"), round(_PITCH_INTERVAL / signals.grid.step)
    moving = np.where(_moves_ahead(signals), 0.0, np.nan)
    within = [
        without_mean(smoothed(values, window), interval)
        for values in (measured_depth_rate(signals) + moving, dive.main, *dive.others)
    ]
    return fit(within[0], within[1], within[2:], window)


def _is_one(fitted: Regression) -> bool:
    return abs(fitted.gain - 1.0) <= _GAIN_TOLERANCE + _GAIN_SIGMAS * fitted.error


def scale_check(signals: Signals, dive: Relation) -> Check:
    """Check the change of depth against pitch and velocities, given a pitch offset (a part u cos(theta))."""
    name = "scale by depth"
    threshold = f"1 +- {_MAX_SCALE_ERROR:g}, if known to {_MAX_SCALE_DEVIATION:g}"
    if max(signals.interval["down"], signals.interval["theta"]) > _SCALE_TIME / _MIN_SCALE_INTERVALS:
        return undetermined("dvl", name, "depth or pitch is measured too seldom", threshold)
    window = signals.window("down", "u", "theta", least=_SCALE_TIME)
    offset_effect = signals.values["u"] * np.cos(signals.values["theta"])
    depth_rate = change(signals.values["down"], window) / (window * signals.grid.step)
    expected, offset = (mean_between_middles(rate, window) for rate in (dive.total(), offset_effect))
    fitted = fit(depth_rate, expected, [offset], window)
    if fitted is None or not fitted.error <= _MAX_SCALE_DEVIATION:
        return undetermined("dvl", name, "the vehicle hardly dives, or not for long", threshold)
    return judged(
        "dvl",
        name,
        statistic=f"depth changes {fitted.gain:.4f} +- {fitted.error:.2g} times the change from velocity and pitch",
        threshold=threshold,
        passed=None if abs(fitted.gain - 1.0) > max(_MAX_SCALE_ERROR, _SCALE_SIGMAS * fitted.error) else True,
        advice="One scale is wrong: the speed of sound of the DVL, or the water density of the depth (salt and fresh "
        f"differ by 2.7 %). If the depth is right, multiply the velocities by {fitted.gain:.4g} (`scale` in the map) "
        "or estimate their scale (`identification.estimate.biases: [dvl]`).",
    )


def offset_by_depth(signals: Signals, dive: Relation) -> PitchOffset | None:
    """Return the pitch offset from the depth rate that pitch and speed do not explain; None if hardly under way."""
    unexplained = measured_depth_rate(signals) - dive.total()
    return _pitch_offset(signals, np.where(_moves_ahead(signals), unexplained, np.nan), signals.values["u"])


def offset_by_gravity(signals: Signals, forward: Relation) -> PitchOffset | None:
    """Return the pitch offset from gravity along the x axis of the accelerometer."""
    unexplained = signals.values["fx"] - forward.total()
    return _pitch_offset(signals, unexplained, np.full(unexplained.size, -GRAVITY))


def _moves_ahead(signals: Signals) -> NDArray[np.bool_]:
    u = signals.values["u"]
    return u >= _AHEAD_SHARE * np.nanquantile(u, 0.9)


def _pitch_offset(signals: Signals, unexplained: Array, weight: Array) -> PitchOffset | None:
    """Solve `unexplained` = `weight` (sin(theta) - sin(theta - offset)), interval by interval."""
    grid, theta = signals.grid, signals.values["theta"]
    finite = np.isfinite(unexplained) & np.isfinite(weight) & np.isfinite(theta)
    length = max(round(_PITCH_INTERVAL / grid.step), -(-grid.cells // _MAX_PITCH_INTERVALS))
    starts, offsets = [], []
    for start in range(0, grid.cells, length):
        interval = slice(start, start + length)
        inside = finite[interval]
        # An interval with few values counts only if the run has no other.
        if inside.sum() >= 0.5 * min(length, grid.cells):
            starts.append(start)
            parts = (values[interval][inside] for values in (unexplained, weight, theta))
            offsets.append(_offset_of_interval(*parts))
    if not offsets:
        return None
    by_interval = np.array(offsets)
    usual = float(np.median(by_interval))
    first, end = _longest_run(np.where(np.abs(by_interval) > _PITCH_OFFSET_FAILURE, np.sign(by_interval), 0.0))
    if end - first < _MIN_PITCH_RUN or end - first == by_interval.size:
        return PitchOffset(usual)
    span = grid.start + grid.step * starts[first], grid.start + grid.step * min(starts[end - 1] + length, grid.cells)
    rest = np.delete(by_interval, slice(first, end))
    return PitchOffset(usual, float(np.median(by_interval[first:end])), span, float(np.median(rest)))


def _offset_of_interval(unexplained: Array, weight: Array, theta: Array) -> float:
    # The median is robust against short faults.
    missing, offset = float(np.median(unexplained)), 0.0
    for _ in range(_PITCH_ITERATIONS):
        # sin(theta) - sin(theta - offset) = 2 sin(offset / 2) cos(theta - offset / 2)
        offset = missing / float(np.mean(weight * np.cos(theta - 0.5 * offset)))
    return offset


def _longest_run(signs: Array) -> tuple[int, int]:
    """Return begin and end of the longest run of one sign, without zeros; (0, 0) if there is none."""
    edges = np.flatnonzero(np.diff(signs, prepend=np.nan, append=np.nan))
    runs = [(a, b) for a, b in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True) if signs[a]]
    return max(runs, key=lambda run: run[1] - run[0], default=(0, 0))


def pitch_offset_check(offset: PitchOffset, reference: str) -> Check:
    """Check the pitch offset; `reference` names the signal that it was found with."""
    size = abs(offset.largest)
    when = ""
    if offset.span is not None and offset.rest is not None:
        start, end = offset.span
        when = f" from t = {start:.4g} to {end:.4g} s, {np.rad2deg(offset.rest):+.2g} deg in the rest"
    return judged(
        "attitude",
        "pitch offset",
        statistic=f"theta is {np.rad2deg(offset.largest):+.2g} deg off compared with the {reference}{when}",
        threshold=f"<= {np.rad2deg(_PITCH_OFFSET_NOTE):.2g} deg; fails beyond "
        f"{np.rad2deg(_PITCH_OFFSET_FAILURE):.2g} deg",
        passed=True if size <= _PITCH_OFFSET_NOTE else None if size <= _PITCH_OFFSET_FAILURE else False,
        advice="The pitch is wrong for a part of the run: use another source, or identify from the rest (`--use`)."
        if when
        else "The sensor of theta, or of the velocity, is mounted at an angle: correct theta by it (`offset` in the "
        "map), or the mounting of the DVL (`mount`).",
    )
