"""Plots as data, which figures and pages draw: thinned series, units, limits of axes, and one class per plot."""

from collections.abc import Iterable, Mapping, Sequence
from math import isfinite
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.arrays import Array, wrap
from auvid_cli.data.dataset import TruthRecord
from auvid_cli.data.estimate import EstimateHistory, Innovations
from auvid_cli.evaluation.results import FreeRun, Identifiability
from auvid_cli.report.table import unit_text
from auvid_cli.validation.results import AHEAD, Prediction
from auvid_cli.vehicle.parameters import (
    DEPTH,
    MOTION,
    MOTION_AND_DEPTH,
    MOTION_AND_DEPTH_SYMBOLS,
    MOTION_SYMBOLS,
    Quantity,
    state_of,
)
from auvid_cli.vehicle.rigid_body import dead_reckoned

_DEGREES = float(np.rad2deg(1.0))
# A line is broken where time advances by more than both of these.
_JUMP = 20.0  # median intervals
_MIN_JUMP = 1.0  # s
_MARGIN = 0.08  # share of the range of the values
# Share of a run's estimates inside the limits of an axis; brief excursions beyond are cut off.
SHOWN_PERCENT = 98.0  # %
# Start of a logarithmic time axis.
_FIRST_SHARE = 1e-3  # share of the run
_SHORTEST = 1e-3  # s
_BAND_POINTS = 100
# Points of a line in the figures of the coefficients.
_LINE_POINTS = 200
_ESTIMATE_POINTS = 600
# Limits of the convergence plots.
_HIGHEST = 1e3  # %, unless lines end higher
_ABOVE = 3.0  # times the largest end of a line
_BELOW = 0.03  # times the smallest band
_SPAN = 1e9  # largest ratio of the limits
# Largest error of a run in figures of a campaign, %; larger ones are drawn here.
MAX_ERROR = 1e3
# Longest bar of the bounds, also for a coefficient without a bound, %.
_MAX_BOUND = 1e4


class Scale(NamedTuple):
    """A unit, and the number of these units in an SI unit."""

    unit: str
    factor: float


_READABLE = {"rad": Scale("°", _DEGREES), "rad/s": Scale("°/s", _DEGREES), "T": Scale("µT", 1e6)}


def scale_of(quantity: Quantity) -> Scale:
    """Return the unit in which a quantity is shown: angles and rates in degrees."""
    return _READABLE.get(quantity.unit, Scale(unit_text(quantity.unit), 1.0))


def finite(values: Array) -> Array:
    """Return values with NaN instead of infinity; NaN breaks a line."""
    return np.where(np.isfinite(values), values, np.nan)


def thin(time: Array, values: Array, points: int = 2000) -> tuple[Array, Array]:
    """Return about `points` samples: the least and the greatest of each part, so that noise keeps its width.

    Values that are not finite are gaps; a gap that fills a part, and a jump of time, remain gaps.
    """
    time, values = broken(time, finite(values))
    n = values.size
    if n <= points:
        return time, values
    least, greatest = _extremes(values, -(-n // (points // 2)))
    kept = np.unique(np.concatenate([[0], least, greatest, [n - 1]]))
    return time[kept], values[kept]


def envelope(time: Array, values: Array, parts: int) -> tuple[Array, Array]:
    """Return the least and the greatest value of each of equal parts, in their order; see `thin`.

    Times are the beginning and the middle of each part, so that series with the same times share them.
    """
    time, values = broken(time, finite(values))
    n = values.size
    if n <= 2 * parts:
        return time, values
    length = -(-n // parts)
    begin = np.arange(0, n, length)
    middle = np.minimum(begin + length // 2, n - 1)
    in_order = np.sort(np.stack(_extremes(values, length), axis=1), axis=1)
    return time[np.stack([begin, middle], axis=1).ravel()], values[in_order.ravel()]


def _extremes(values: Array, length: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the indices of the least and of the greatest value in each part of `length` samples."""
    parts = -(-values.size // length)
    padded = np.full(parts * length, np.nan)
    padded[: values.size] = values
    block = padded.reshape(parts, length)
    gap = np.isnan(block)
    begin = np.arange(parts) * length
    block[gap] = np.inf
    least = block.argmin(axis=1)
    block[gap] = -np.inf
    return begin + least, begin + block.argmax(axis=1)


def broken(time: Array, values: Array) -> tuple[Array, Array]:
    """Insert a gap, NaN, wherever time jumps."""
    steps = np.diff(time)
    if not steps.size:
        return time, values
    jumps = np.flatnonzero(steps > max(_JUMP * float(np.median(steps)), _MIN_JUMP)) + 1
    if not jumps.size:
        return time, values
    return np.insert(time, jumps, time[jumps]), np.insert(values, jumps, np.nan)


def spaced(n: int, points: int) -> NDArray[np.int64]:
    """Return indices of at most `points` samples evenly spaced, with the first and the last; for smooth series."""
    return np.unique(np.linspace(0, max(n - 1, 0), min(n, points)).astype(np.int64))


def log_spaced(time: Array, first: float, points: int) -> NDArray[np.int64]:
    """Return indices of at most `points` samples evenly spaced in the logarithm of time from `first`, s, to the end."""
    last = float(time[-1])
    wanted = np.geomspace(min(first, last), last, points) if last > 0.0 else np.zeros(1)
    return np.unique(np.clip(np.searchsorted(time, wanted), 0, time.size - 1))


def unwrapped(angle: Array) -> Array:
    """Return an angle, rad, without jumps of a turn; gaps stay gaps."""
    result = finite(angle)
    is_known = ~np.isnan(result)
    result[is_known] = np.unwrap(result[is_known])
    return result


def value_range(*series: Array) -> tuple[float, float] | None:
    """Return least and greatest finite value, None if there is none."""
    finite = [values[np.isfinite(values)] for values in series]
    present = [values for values in finite if values.size]
    if not present:
        return None
    return min(float(values.min()) for values in present), max(float(values.max()) for values in present)


def with_margin(low: float, high: float) -> tuple[float, float]:
    """Return limits with a margin on both sides, also around a single value."""
    room = _MARGIN * (high - low) or 0.05 * abs(high) or 1.0
    return low - room, high + room


def around(reference: tuple[float, float] | None, others: tuple[float, float] | None) -> tuple[float, float]:
    """Return limits around a reference range, extended to other ranges by at most its own height."""
    if reference is None:
        return with_margin(*others) if others is not None else (-1.0, 1.0)
    low, high = reference
    if others is not None:
        height = high - low
        low, high = max(min(low, others[0]), low - height), min(max(high, others[1]), high + height)
    return with_margin(low, high)


class CoefficientLine(NamedTuple):
    """Line of one filter in the plot of a coefficient."""

    filter: str
    completed: bool  # whether the filter reached the end of the data
    time: Array  # s, shape (n,)
    values: Array  # in the unit of the plot, shape (n,); NaN breaks the line
    end: float  # value at the last time
    band_time: Array = np.empty(0)  # times of the band, s, shape (m,); empty without a band
    band: Array = np.empty(0)  # upper edge of two standard deviations, shape (m,); empty without a band


class CoefficientPlot(NamedTuple):
    """Description of the plot of one coefficient over time, for figures and pages."""

    symbol: str
    lines: list[CoefficientLine]  # one for each filter
    true: float | None  # SI
    limits: tuple[float, float] | None  # limits of the ordinate; None for automatic ones
    begin: float  # lower limit of the time axis, s
    end: float  # upper limit of the time axis, s


class CoefficientPlots(NamedTuple):
    """Plots of several coefficients for one figure; small, because it is sent to another process."""

    plots: list[CoefficientPlot]
    filters: list[str]
    span: tuple[float, float]  # first and last time of all estimates, s
    has_truth: bool


def estimate_plots(
    symbols: Iterable[str], estimates: Sequence[EstimateHistory], true: Mapping[str, float]
) -> CoefficientPlots:
    """Return the estimates of each coefficient over time; `true` has the known true values by symbol, SI."""
    plots = [estimate_plot(symbol, estimates, true.get(symbol), _ESTIMATE_POINTS) for symbol in symbols]
    return CoefficientPlots(plots, [estimate.filter for estimate in estimates], time_span(estimates), bool(true))


def convergence_plots(
    symbols: Iterable[str], estimates: Sequence[EstimateHistory], true: Mapping[str, float]
) -> CoefficientPlots:
    """Return the distances of each coefficient from its true or final value; `true` as in `estimate_plots`."""
    plots = [convergence_plot(symbol, estimates, true.get(symbol), _LINE_POINTS) for symbol in symbols]
    return CoefficientPlots(plots, [estimate.filter for estimate in estimates], time_span(estimates), bool(true))


def estimate_plot(
    symbol: str, estimates: Sequence[EstimateHistory], true: float | None, points: int
) -> CoefficientPlot:
    """Describe the plot of a coefficient's estimates, SI, over the logarithm of time.

    The limits contain the true value, the start, the end and `SHOWN_PERCENT` of the estimates of each filter that
    completed, or of all if none did; they are None without a finite estimate. Each line has at most `points` points.
    """
    span = time_span(estimates)
    begin = max(span[1] * _FIRST_SHARE, _SHORTEST)
    shown = [estimate for estimate in estimates if symbol in estimate.state and estimate.time.size]
    means = [estimate.mean[:, estimate.state.index(symbol)] for estimate in shown]
    lines = []
    for estimate, mean in zip(shown, means, strict=True):
        some = log_spaced(estimate.time, begin, points)
        lines.append(
            CoefficientLine(
                estimate.filter, estimate.completed, estimate.time[some], finite(mean[some]), float(mean[-1])
            )
        )
    end = max(span[1], 10.0 * begin)
    completed = [mean for estimate, mean in zip(shown, means, strict=True) if estimate.completed]
    return CoefficientPlot(symbol, lines, true, _estimate_limits(completed or means, true), begin, end)


def _estimate_limits(means: Sequence[Array], true: float | None) -> tuple[float, float] | None:
    cut = 0.5 * (100.0 - SHOWN_PERCENT)
    known = [mean[np.isfinite(mean)] for mean in means]
    values = [np.append(np.percentile(mean, [cut, 100.0 - cut]), mean[[0, -1]]) for mean in known if mean.size]
    if not values:
        return None
    shown = np.concatenate([*values, [] if true is None else [true]])
    return with_margin(float(shown.min()), float(shown.max()))


def convergence_plot(
    symbol: str, estimates: Sequence[EstimateHistory], true: float | None, points: int
) -> CoefficientPlot:
    """Describe the plot of a coefficient's distance from its true value over time, in percent of that value.

    The final estimate of each filter replaces a true value that is unknown or zero; a filter whose final estimate is
    zero or not finite has no line then. The run is cut into at most `points` parts, and each point of a line is the
    largest distance in one part, because the smallest is where the estimate crosses the true value.
    """
    lines = []
    for estimate in estimates:
        if symbol not in estimate.state or not estimate.time.size:
            continue
        column = estimate.state.index(symbol)
        mean, deviation = estimate.mean[:, column], estimate.standard_deviation[:, column]
        origin = true or float(mean[-1])
        if not isfinite(origin) or origin == 0.0:
            continue
        percent = 100.0 * np.abs(mean / origin - 1.0)
        end = float(percent[-1])
        # A logarithmic axis has no zero. A batch estimate is constant, and zero from its own final value.
        percent[~np.isfinite(percent) | (percent == 0.0)] = np.nan
        part = np.arange(0, percent.size, -(-percent.size // points))
        largest = np.fmax.reduceat(percent, part)
        some = spaced(mean.size, _BAND_POINTS)
        band = 200.0 * deviation[some] / abs(origin)
        time = estimate.time
        lines.append(CoefficientLine(estimate.filter, estimate.completed, time[part], largest, end, time[some], band))
    return CoefficientPlot(symbol, lines, true, None, *time_span(estimates))


def convergence_limits(plots: Sequence[CoefficientPlot]) -> tuple[float, float]:
    """Return limits in percent that suit all plots: by the bands at both ends, and by the ends of the lines."""
    lines = [line for plot in plots for line in plot.lines]
    # A filter that diverged would compress the others, so it counts only if all diverged.
    counting = [line for line in lines if line.completed] or lines
    bands = [line.band[[0, -1]] for line in counting]
    low, high = value_range(*(band[band > 0.0] for band in bands)) or (0.1, _HIGHEST)
    _, last = value_range(*(np.array([line.end]) for line in counting)) or (0.0, 0.0)
    high = max(min(high, _HIGHEST), min(_ABOVE * last, _HIGHEST**2))
    return min(max(_BELOW * low, high / _SPAN), 0.01 * high), high


def time_span(estimates: Sequence[EstimateHistory]) -> tuple[float, float]:
    """Return the first and the last time of all estimates, s."""
    return value_range(*(estimate.time for estimate in estimates)) or (0.0, 1.0)


def free_run_residual(quantity: Quantity, time: Array, measured: Array, run: FreeRun) -> Array | None:
    """Return measurements minus a free run, SI; None where that has no such motion.

    Parameters
    ----------
    quantity : Quantity
        Component of a sensor.
    time, measured : ndarray, shape (n,)

    Returns
    -------
    ndarray, shape (n,), or None
        NaN outside of the run and where it is not finite; angles between -pi and pi.
    """
    state = state_of(quantity)
    if state not in MOTION_AND_DEPTH_SYMBOLS or run.time.size < 2:
        return None
    column = MOTION_AND_DEPTH_SYMBOLS.index(state)
    if column >= run.motion.shape[1]:
        return None
    left = measured - interpolated(time, run, column)
    return wrap(left) if quantity.unit == "rad" else left


def interpolated(time: Array, run: FreeRun, column: int) -> Array:
    """Return a motion state of a free run at other times, s; NaN outside of it and where it is not finite."""
    finite = np.isfinite(run.motion[:, column])
    values = np.where(finite, run.motion[:, column], 0.0)
    if MOTION_AND_DEPTH_SYMBOLS[column] in ("phi", "theta", "psi"):
        values = np.unwrap(values)
    result = np.interp(time, run.time, values, left=np.nan, right=np.nan)
    # The value between two samples is unknown if one of them is not finite.
    return np.where(np.interp(time, run.time, finite.astype(np.float64)) == 1.0, result, np.nan)


class ComponentInnovations(NamedTuple):
    """Finite innovations of a component of a sensor that the filter used."""

    time: Array  # shape (n,); s
    # values, deviation: shape (n,); innovations and their standard deviations, SI
    values: Array
    deviation: Array
    normalised: Array  # shape (n,); ratio of both

    @property
    def percent_within(self) -> float:
        """Return the share within two standard deviations, %."""
        return 100.0 * float((np.abs(self.normalised) <= 2.0).mean())


def component_innovations(innovations: Innovations, component: int) -> ComponentInnovations:
    """Return the innovations of one component."""
    with np.errstate(invalid="ignore", divide="ignore"):
        deviation = np.sqrt(innovations.variance[:, component])
        normalised = innovations.innovation[:, component] / deviation
    known = np.isfinite(normalised)
    values = innovations.innovation[known, component]
    return ComponentInnovations(innovations.time[known], values, deviation[known], normalised[known])


# Errors that are compared in the plot of a signal; fields of `Prediction`.
HORIZON_ERRORS = ("rmse", "prior_rmse", "vehicle_file_rmse", "constant_velocity_rmse", "expected_rmse", "noise")


class HorizonPlot(NamedTuple):
    """Errors of predictions of one signal over the horizon."""

    quantity: Quantity
    scale: Scale  # unit of the errors
    horizons: Array  # shape (n,); s; empty if the signal was not measured ahead
    errors: dict[str, Array]  # shape (n,); by field of `HORIZON_ERRORS`; NaN where unknown


def horizon_plots(predictions: Sequence[Prediction]) -> list[HorizonPlot]:
    """Return a plot for each motion state, and for the depth if it is predicted."""
    has_depth = any(row.signal == DEPTH.symbol for row in predictions)
    plots = []
    for quantity in MOTION_AND_DEPTH if has_depth else MOTION:
        rows = [row for row in predictions if row.kind == AHEAD and row.signal == quantity.symbol]
        scale = scale_of(quantity)
        columns = {field: [getattr(row, field) for row in rows] for field in HORIZON_ERRORS}
        errors = {
            field: np.array([np.nan if value is None else scale.factor * value for value in values])
            for field, values in columns.items()
        }
        plots.append(HorizonPlot(quantity, scale, np.array([row.horizon_s for row in rows]), errors))
    return plots


class BoundsPlot(NamedTuple):
    """Cramér-Rao bounds in percent of the coefficients, for a logarithmic axis."""

    percents: Array  # shape (n,), from all data; within the limits of the axis
    times: Array  # shape (k,), s
    growth: Array  # shape (k, n), from the data until each time; NaN beyond the axis


def bounds_plot(identifiability: Identifiability) -> BoundsPlot:
    """Return the bounds of all coefficients, and how they fall with the duration."""
    percents = np.array([bound.percent for bound in identifiability.bounds])
    times = np.array([time for time, _ in identifiability.growth])
    growth = np.array([percent for _, percent in identifiability.growth])
    drawable = (growth > 0.0) & (growth < _MAX_BOUND)
    return BoundsPlot(np.clip(percents, 1e-6, _MAX_BOUND), times, np.where(drawable, growth, np.nan))


class TravelledPath(NamedTuple):
    """A path."""

    filter: str | None  # none of the true one
    time: Array  # shape (n,); s
    position: Array  # shape (n, 3); north, east, down, m


def travelled_paths(truth: TruthRecord | None, motions: Iterable[EstimateHistory]) -> list[TravelledPath]:
    """Return the true path, where finite, and dead reckoning from its start, or from zero without truth.

    Parameters
    ----------
    motions : iterable of EstimateHistory
        Histories of the nine motion states, and of the depth where it is estimated, which then replaces that of dead
        reckoning. One that is not finite from its second time has no path.
    """
    paths, start = list[TravelledPath](), np.zeros(3)
    if truth is not None:
        known = np.isfinite(truth.position).all(axis=1)
        if known.any():
            paths.append(TravelledPath(None, truth.time[known], truth.position[known]))
            start = paths[0].position[0]
    for motion in motions:
        columns = [motion.state.index(symbol) for symbol in MOTION_SYMBOLS]
        position = start + dead_reckoned(motion.time, motion.mean[:, columns])
        if DEPTH.symbol in motion.state:
            position[:, 2] = motion.mean[: len(position), motion.state.index(DEPTH.symbol)]
        if len(position) > 1:
            paths.append(TravelledPath(motion.filter, motion.time[: len(position)], position))
    return paths


def travelled(position: Array) -> Array:
    """Return the horizontal distance along a path, m, shape (n,)."""
    return np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(position[:, :2], axis=0).T))])
