"""Delays of inputs and sensors, from the lag of one signal to another."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.arrays import Array
from auvid_cli.data.checks import Check
from auvid_cli.data.signals import rate_of_change, response_to_rates
from auvid_cli.inspection.fins import LinearMotion, predicted_response
from auvid_cli.inspection.inspection import UNDETERMINED, judged, undetermined
from auvid_cli.inspection.kinematic_relations import (
    Signals,
    attitude_rates,
    attitude_window,
    diving_speed,
    measured_forces,
    smoothed,
)
from auvid_cli.inspection.responses import AXES, MIN_DEFLECTION, RotationAxis, response_window
from auvid_cli.vehicle.parameters import INPUT_SYMBOLS

_LIKELIHOOD_MARGIN = 10.0  # increase of the log-likelihood at which another sign, fin or lag is preferred
# Largest apparent delay of inputs that are not delayed, s.
_MAX_GOOD_FIT_DELAY = 0.075  # where the vehicle file predicts the rotation well
_MAX_DELAY_SHARE = 0.05  # or this share of the vehicle's time constant, if that is longer
_MAX_DELAY_WITHOUT_FILE = 0.3  # without coefficients in the vehicle file
_MAX_POOR_FIT_DELAY = 0.6  # where the vehicle file predicts the rotation poorly
_MAX_FIN_LAG = 0.6  # s, lag of slow fins, by which inputs may be early
_MAX_INPUT_LAG = 3.0  # s, longest delay of the inputs that is considered
_GOOD_FIT_CORRELATION = 0.9  # partial correlation from which the vehicle file predicts well
_MIN_INPUT_CORRELATION = 0.4  # partial correlation from which a response shows a lag
_MIN_FIN_CHANGE = 0.1  # change of a fin within the delay, in its standard deviations, that distorts coefficients
_DELAY_SIGMAS = 2.0
_MIN_WINDOWS = 15
_MAX_ROWS = 10_000
_MAX_EXPLAINED = 1.0 - 1e-9  # largest explained share of a variance
_ROUNDING = 1e-9
_OTHER_FIN = {"elevator": "rudder", "rudder": "elevator"}
_SENSOR_DELAY_NOTE = 0.075  # s, typical of the filters of an attitude reference
_SENSOR_DELAY_FAILURE = 0.15  # s
_MAX_SENSOR_LAG = 1.5  # s, longest delay of a sensor that is considered
_AFT_SHARE = 0.25  # apparent delay of a depth sensor far aft, as a share of the vehicle's time constant
_MIN_SENSOR_CORRELATION = 0.8
_OTHER_REASONS = {
    "depth": " Or the depth sensor is far from the origin.",
    "dvl": " Or the DVL is ahead or aft of the accelerometer.",
}


def shifted(values: Array, cells: int) -> Array:
    """Return values `cells` earlier, or later if negative; NaN at the end without values."""
    lost = np.full(min(abs(cells), values.size), np.nan)
    return np.concatenate([values[cells:], lost] if cells > 0 else [lost, values[: max(values.size + cells, 0)]])


def peak(likelihood: Array, at: int) -> tuple[float, float]:
    """Return the peak of the parabola through three log-likelihoods, in cells from `at`, and its standard deviation.

    Both are 0 without such a peak.
    """
    if not 0 < at < likelihood.size - 1 or likelihood[at] < max(likelihood[at - 1], likelihood[at + 1]):
        return 0.0, 0.0
    before, middle, after = likelihood[at - 1 : at + 2]
    curvature = before - 2.0 * middle + after
    return (float(0.5 * (before - after) / curvature), float((-curvature) ** -0.5)) if curvature < 0.0 else (0.0, 0.0)


def likeliest_lag(likelihood: Array) -> tuple[float, float]:
    """Return the most likely of lags symmetric about 0, and its standard deviation, in cells."""
    at = int(likelihood.argmax())
    beyond, error = peak(likelihood, at)
    return at - likelihood.size // 2 + beyond, error


class Alignment(NamedTuple):
    """Delay of the inputs, and assignment of the fins."""

    delay: float | None  # time stamps of the inputs minus those of the motion, s; None if undetermined
    exchanged: bool | None  # whether the columns of rudder and elevator are exchanged
    share: float = 0.0  # change of the faster fin within the delay, in its standard deviations
    usual: float = _MAX_DELAY_WITHOUT_FILE  # largest apparent delay of inputs that are not delayed, s
    error: float = 0.0  # standard deviation of the delay due to noise, s
    is_clear: bool = True  # whether no delay longer than `usual` is more likely than this one
    gain: float = 0.0  # increase of the log-likelihood over no delay

    @property
    def is_delayed(self) -> bool:
        """Whether the delay is significant."""
        return self.delay is not None and abs(self.delay) - _DELAY_SIGMAS * self.error > self.usual

    @property
    def distorts(self) -> bool:
        """Whether the delay makes coefficients of the fins wrong."""
        return (
            self.delay is not None
            and self.is_delayed
            and self.share > _MIN_FIN_CHANGE
            and not -_MAX_FIN_LAG <= self.delay < 0.0
        )


def input_alignment(signals: Signals, motion: LinearMotion | None, time_constant: float | None) -> Alignment:
    """Return the assignment of the fins and the common delay of all inputs that explain the rotation best.

    Signs do not matter here: they are checked with aligned inputs.

    Parameters
    ----------
    signals : Signals
    motion : LinearMotion or None
        From the vehicle file; its own lag from input to response does not count as a delay.
    time_constant : float or None
        Time constant of the vehicle, s, if known.
    """
    roll, *fins = AXES
    crossed_fins = [axis._replace(input=_OTHER_FIN[axis.input]) for axis in fins]
    fits = [_input_likelihood(signals, axes, motion, time_constant) for axes in ([roll], fins, crossed_fins)]
    by_roll, as_named, crossed = (likelihood for likelihood, _ in fits)
    if motion is None:
        usual = _MAX_DELAY_WITHOUT_FILE
    elif max(correlation for _, correlation in fits) >= _GOOD_FIT_CORRELATION:
        usual = max(_MAX_GOOD_FIT_DELAY, _MAX_DELAY_SHARE * (time_constant or 0.0))
    else:
        usual = _MAX_POOR_FIT_DELAY
    as_named, crossed = as_named + by_roll, crossed + by_roll
    if not max(as_named.max(), crossed.max()) > 0.0:
        return Alignment(None, None)
    exchanged = bool(crossed.max() > as_named.max() + _LIKELIHOOD_MARGIN)
    step = signals.grid.step
    likelihood, lags = crossed if exchanged else as_named, _lags(signals, _MAX_INPUT_LAG)
    short = np.abs(lags) * step <= usual + 0.5 * step
    best = int(likelihood.argmax())
    is_clear = bool(short[best] or likelihood[best] > likelihood[short].max() + _LIKELIHOOD_MARGIN)
    if not is_clear:
        best = int(np.where(short, likelihood, -np.inf).argmax())
    beyond, error = peak(likelihood, best)
    cells = float(lags[best]) + beyond
    gain = float(likelihood[best] - likelihood[lags.size // 2])
    return Alignment(cells * step, exchanged, _fin_change(signals, cells), usual, error * step, is_clear, gain)


def _fin_change(signals: Signals, cells: float) -> float:
    """Return the RMS change of the faster fin within `cells`, in its standard deviations."""
    shares, whole = [0.0], max(round(abs(cells)), 1)
    for fin in _OTHER_FIN:
        deflection = signals.values[fin]
        if (spread := float(np.nanstd(deflection))) > MIN_DEFLECTION:
            changes = float(np.sqrt(np.nanmean(np.square(shifted(deflection, whole) - deflection))))
            shares.append(changes / spread * min(abs(cells) / whole, 1.0))
    return max(shares)


def aligned(signals: Signals, alignment: Alignment) -> Signals:
    """Return signals with exchanged fins and delayed inputs corrected."""
    value = dict(signals.values)
    if alignment.exchanged:
        value["rudder"], value["elevator"] = value["elevator"], value["rudder"]
    if alignment.is_delayed and alignment.delay is not None:
        cells = round(alignment.delay / signals.grid.step)
        for symbol in INPUT_SYMBOLS:
            value[symbol] = shifted(value[symbol], cells)
    return signals._replace(values=value)


def alignment_checks(alignment: Alignment) -> list[Check]:
    """Check the delay of the inputs and the assignment of the fins."""
    assignment = "r responds to rudder, q to elevator"
    limit = (
        f"<= {alignment.usual:.2g} s; fails if a fin changes by {_MIN_FIN_CHANGE:.0%} within the delay, or if inputs "
        f"are more than {_MAX_FIN_LAG:g} s early"
    )
    if alignment.delay is None or alignment.exchanged is None:
        reason = "no rotation responds to an input"
        return [
            undetermined("inputs", "delay", reason, limit),
            undetermined("inputs", "rudder and elevator", reason, assignment),
        ]
    delay = alignment.delay
    if delay >= 0.0:
        size, reason = (
            f"lag behind the motion by {delay:.2f} s",
            "Inputs that come after their effect distort coefficients",
        )
    else:
        size = f"are {-delay:.2f} s ahead of the motion"
        reason = "Fins are slow (`vehicle.actuators.fins.time_constant`), or the clock of their commands is ahead"
    unclear = "" if alignment.is_clear else f"{UNDETERMINED}, a longer delay is as likely: "
    passed = not alignment.is_delayed
    if not alignment.is_clear or (alignment.is_delayed and not alignment.distorts):
        passed = None
    return [
        judged(
            "inputs",
            "delay",
            statistic=f"{unclear}inputs {size}, within which a fin changes by {alignment.share:.0%}",
            threshold=limit,
            passed=passed,
            advice=f"{reason}: state the delay (`identification.delays={{inputs: {-delay:.2g} s}}`), or shift the "
            "times. If only samples of the inputs are recorded, they seem half an interval late: set "
            "`identification.inputs.between: linear`. Signs were checked with shifted inputs.",
        ),
        judged(
            "inputs",
            "rudder and elevator",
            statistic="r responds to elevator, q to rudder" if alignment.exchanged else assignment,
            threshold=assignment,
            passed=not alignment.exchanged,
            advice="The columns of rudder and elevator are exchanged: exchange their names in the map. Signs were "
            "checked with exchanged columns.",
        ),
    ]


def _input_likelihood(
    signals: Signals, axes: Sequence[RotationAxis], motion: LinearMotion | None, time_constant: float | None
) -> tuple[Array, float]:
    """Return the log-likelihood ratio of responses to none, by lag, and the best correlation."""
    total, best = np.zeros(_lags(signals, _MAX_INPUT_LAG).size), 0.0
    for axis in axes:
        correlation, windows = _correlations(signals, axis, motion, time_constant)
        best = max(best, float(np.abs(correlation).max()))
        if np.abs(correlation).max() >= _MIN_INPUT_CORRELATION:
            total -= 0.5 * windows * np.log1p(-np.minimum(correlation**2, _MAX_EXPLAINED))
    return total, best


def _correlations(
    signals: Signals, axis: RotationAxis, motion: LinearMotion | None, time_constant: float | None
) -> tuple[Array, float]:
    """Return the partial correlation of the change of a rate with its prediction from delayed inputs.

    Returns
    -------
    correlation : ndarray
        By lag; 0 where undetermined.
    windows : float
        Number of averages that do not overlap.
    """
    lags = _lags(signals, _MAX_INPUT_LAG)
    response = predicted_response(signals, axis, motion, response_window(signals, axis, time_constant))
    if response is None:
        return np.zeros(lags.size), 0.0
    rows = np.stack([response.change, *response.covariates])
    complete = np.isfinite(rows).all(axis=0)
    complete &= np.isfinite(shifted(smoothed(response.predicted, lags.size), int(lags[0])))
    at = np.flatnonzero(complete)
    windows = at.size / response.window
    if windows < _MIN_WINDOWS:
        return np.zeros(lags.size), 0.0
    at = at[:: 1 + at.size // _MAX_ROWS]
    covariates = np.stack([np.ones(at.size), *rows[1:, at]], axis=1)
    basis, _ = np.linalg.qr(covariates / np.maximum(np.abs(covariates).max(axis=0), np.finfo(np.float64).tiny))
    changed = _normalised_residual(rows[0, at], basis)
    return np.array([changed @ _normalised_residual(response.predicted[at + lag], basis) for lag in lags]), windows


def _normalised_residual(values: Array, basis: Array) -> Array:
    """Return the part of a signal outside an orthonormal basis, of length 1; 0 if that is rounding."""
    residual = values - basis @ (basis.T @ values)
    length = float(np.linalg.norm(residual))
    return residual / length if length > _ROUNDING * float(np.linalg.norm(values)) else 0.0 * residual


def _lags(signals: Signals, longest: float) -> NDArray[np.int64]:
    """Return lags from `-longest` to `longest`, s, in cells."""
    most = round(longest / signals.grid.step)
    return np.arange(-most, most + 1)


class _Pair(NamedTuple):
    """A derivative as one sensor measures it, and as others predict it, smoothed alike."""

    sensor: str
    other: str
    measured: Array
    expected: Array
    reversed_w: Array | None = None  # prediction with the sign of w reversed, which looks like a delay
    is_of_lever_arm: bool = False  # whether a lever arm between the sensors looks like a delay


def sensor_delay_checks(signals: Signals, time_constant: float | None, contradicted: bool) -> list[Check]:
    """Check the delay of each sensor against others, where their signals agree well enough.

    `time_constant` is that of the vehicle, s, if known. With `contradicted` rates and angles only their own delay is
    checked.
    """
    window = attitude_window(signals)
    by_sensors: dict[tuple[str, str], list[_Pair]] = {}
    for pair in _pairs(signals, window // 2):
        if contradicted and pair.sensor != "gyroscope":
            continue
        by_sensors.setdefault((pair.sensor, pair.other), []).append(pair)
    # A DVL ahead of the accelerometer looks late. So a lag of these two is only a note, unless surge, which no lever
    # arm affects, shows it by itself.
    surge = [pair for pair in by_sensors.get(("dvl", "accelerometer"), ()) if not pair.is_of_lever_arm]
    lag = _lag(signals, surge, window)
    late = lag is not None and lag.least > _SENSOR_DELAY_FAILURE
    failure = {
        "depth": _SENSOR_DELAY_FAILURE + _AFT_SHARE * (time_constant or 0.0),
        "dvl": _SENSOR_DELAY_FAILURE if late else np.inf,
    }
    return [
        _sensor_delay_check(sensor, other, found, failure.get(sensor, _SENSOR_DELAY_FAILURE))
        for (sensor, other), pairs in by_sensors.items()
        if (found := _lag(signals, pairs, window)) is not None
    ]


def _pairs(signals: Signals, half: int) -> Iterator[_Pair]:
    step, value = signals.grid.step, signals.values
    for rate, relation in attitude_rates(signals).items():
        if signals.has(rate):
            yield _Pair("gyroscope", "attitude", response_to_rates(value[rate], step, half), relation.total())
    dive = diving_speed(signals)
    if dive is not None and signals.has("down", "w"):
        measured = rate_of_change(value["down"], step, half)
        expected, reversed_w = (
            response_to_rates(dive.total() - 2.0 * by * dive.others[0], step, half) for by in (0.0, 1.0)
        )
        yield _Pair("depth", "attitude", measured, expected, reversed_w)
    for velocity, force in measured_forces(signals).items():
        acceleration = value[f"f{'xyz'['uvw'.index(velocity)]}"] - sum(force.others)
        measured = rate_of_change(value[velocity], step, half)
        expected = response_to_rates(acceleration, step, half)
        yield _Pair("dvl", "accelerometer", measured, expected, is_of_lever_arm=velocity != "u")


class _Lag(NamedTuple):
    """Delay of a measured signal against its prediction, and its standard deviation, s."""

    size: float
    error: float
    is_w_reversed: bool

    @property
    def least(self) -> float:
        """Return the lower bound of its size, s."""
        return abs(self.size) - _DELAY_SIGMAS * self.error


def _lag(signals: Signals, pairs: Sequence[_Pair], window: int) -> _Lag | None:
    """Return the common lag of pairs of signals; None if they hardly agree."""
    step, lags = signals.grid.step, _lags(signals, _MAX_SENSOR_LAG)
    short = np.abs(lags) * step <= _SENSOR_DELAY_NOTE
    likelihood, is_w_reversed = np.zeros(lags.size), False
    for pair in pairs:
        best = _sensor_likelihood(pair.measured, pair.expected, lags, window)
        if pair.reversed_w is not None:
            other_sign = _sensor_likelihood(pair.measured, pair.reversed_w, lags, window)
            if other_sign[short].max() > best.max() + _LIKELIHOOD_MARGIN:
                best, is_w_reversed = other_sign, True
        likelihood += best
    if not likelihood.any():
        return None
    cells, error = likeliest_lag(likelihood)
    return _Lag(cells * step, error * step, is_w_reversed)


def _sensor_delay_check(sensor: str, other: str, lag: _Lag, failure: float) -> Check:
    late, early = (sensor, other) if lag.size > 0.0 else (other, sensor)
    return judged(
        sensor,
        f"delay against {other}",
        statistic=f"{late} is {abs(lag.size):.2f} +- {lag.error:.1g} s later than {early}"
        + (" (with the sign of w reversed)" if lag.is_w_reversed else ""),
        threshold=f"<= {_SENSOR_DELAY_NOTE:g} s" + (f"; fails beyond {failure:.2g} s" if np.isfinite(failure) else ""),
        passed=False if lag.least > failure else None if lag.least > _SENSOR_DELAY_NOTE else True,
        advice=f"{late} is stamped late, or {early} early: shift the times, state the delay (`identification.delays`), "
        f"or estimate it (`identification.estimate.biases: [delay]`).{_OTHER_REASONS.get(sensor, '')}",
    )


def _sensor_likelihood(measured: Array, expected: Array, lags: NDArray[np.int64], window: int) -> Array:
    """Return the log-likelihood ratio of related to unrelated signals, by lag; 0 if they hardly agree."""
    rows = np.stack([shifted(measured, int(lag)) for lag in lags])
    complete = np.isfinite(rows).all(axis=0) & np.isfinite(expected)
    windows = int(complete.sum()) / window
    if windows < _MIN_WINDOWS:
        return np.zeros(lags.size)
    rows, expected = rows[:, complete], expected[complete]
    rows, expected = rows - rows.mean(axis=1, keepdims=True), expected - expected.mean()
    sizes = np.linalg.norm(rows, axis=1) * np.linalg.norm(expected)
    correlations = np.divide(rows @ expected, sizes, out=np.zeros(lags.size), where=sizes > 0.0)
    if correlations.max() < _MIN_SENSOR_CORRELATION:
        return np.zeros(lags.size)
    return -0.5 * windows * np.log1p(-(np.clip(correlations, 0.0, _MAX_EXPLAINED) ** 2))
