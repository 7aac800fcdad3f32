"""How far pitch is off: by the depth that was really gained, or by gravity; all the time or for a while."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.data.check import Check
from auvid_cli.inspection.grid import Signals, smoothed, without_mean
from auvid_cli.inspection.inspection import judged
from auvid_cli.inspection.kinematic_relations import Relation, measured_depth_rate
from auvid_cli.inspection.regression import Regression, fit
from auvid_cli.vehicle.kinematics import GRAVITY

Array = NDArray[np.float64]

_USUAL, _LARGEST = np.deg2rad(2.0), np.deg2rad(5.0)
# s, of an interval of the run, at least; and how many intervals there are at most.
_INTERVAL, _MOST_INTERVALS = 10.0, 1000
# Intervals in a row that an offset lasts, so that it is one.
_FEWEST_IN_A_ROW = 2
# Share of the usual speed at which the vehicle goes where its nose points.
_AHEAD = 0.5
_ROUNDS = 4


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
