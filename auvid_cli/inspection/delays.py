"""Delays of inputs and sensors, from the lag of one signal to another."""

from collections.abc import Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.data.checks import Check
from auvid_cli.data.signals import rate_of_change, response_to_rates
from auvid_cli.inspection.fins import SmallMotion, promised_answer
from auvid_cli.inspection.inspection import cannot_tell, judged
from auvid_cli.inspection.kinematic_relations import (
    Signals,
    attitude_rates,
    attitude_window,
    diving_speed,
    measured_forces,
    smoothed,
)
from auvid_cli.inspection.responses import AXES, LEAST_DEFLECTION, RotationAxis, answer_window
from auvid_cli.vehicle.parameters import INPUT_SYMBOLS

Array = NDArray[np.float64]
# s: a lag that there seems to be where there is none: where the turning is as the vehicle file promises, or that share
# of the vehicle's time constant; where the file has no coefficients; where it promises another turning than there is.
# What slow fins may be behind, and the longest that is looked for.
_PROMISED, _OF_TIME_CONSTANT, _UNKNOWN, _INPUT_OTHERWISE, _EARLIEST, _LONGEST_INPUT_DELAY = (
    0.075,
    0.05,
    0.3,
    0.6,
    0.6,
    3.0,
)
# Partial correlation of what is promised with the turning as it was.
_AS_PROMISED = 0.9
# Share of a fin's deflection by which it changes within a lag that matters.
_MATTERS = 0.1
# Partial correlation of an answer that tells a lag, and how much likelier, as a logarithm, another lag must be.
_LEAST_INPUT_CORRELATION, _INPUT_LIKELIER = 0.4, 10.0
# Standard deviations by which a lag is longer than usual.
_SIGMAS = 2.0
_FEWEST_WINDOWS, _MOST_ROWS = 15, 10_000
_MOST_EXPLAINED, _ROUNDING = 1.0 - 1e-9, 1e-9
_OTHER_FIN = {"elevator": "rudder", "rudder": "elevator"}
# s: what filters of an attitude reference may make, what spoils coefficients of any vehicle, the longest looked for.
_USUAL, _LARGEST, _LONGEST_SENSOR_DELAY = 0.075, 0.15, 1.5
# Share of the vehicle's time constant, its length over its speed: a depth sensor that far aft sees depth so much later.
_AFT = 0.25
# How well signals agree that tell a lag, and how much likelier, as a logarithm, than any delay a
# turned sign must be.
_LEAST_SENSOR_CORRELATION, _FEWEST, _SENSOR_LIKELIER = 0.8, 15.0, 10.0
# What looks like a delay and is none.
_SENSOR_OTHERWISE = {
    "depth": " Or the depth sensor sits ahead or aft.",
    "dvl": " Or the DVL sits ahead or aft of the accelerometer.",
}


def shifted(values: Array, cells: int) -> Array:
    """Shift values so many cells earlier, or later if negative; NaN where nothing is known."""
    lost = np.full(min(abs(cells), values.size), np.nan)
    return np.concatenate([values[cells:], lost] if cells > 0 else [lost, values[: max(values.size + cells, 0)]])


def peak(likelihood: Array, at: int) -> tuple[float, float]:
    """Return how far beyond one of evenly spaced log-likelihoods the parabola about it peaks, and its deviation there.

    Both are 0 where there is no such peak.
    """
    if not 0 < at < likelihood.size - 1 or likelihood[at] < max(likelihood[at - 1], likelihood[at + 1]):
        return 0.0, 0.0
    before, here, after = likelihood[at - 1 : at + 2]
    curvature = before - 2.0 * here + after
    return (float(0.5 * (before - after) / curvature), float((-curvature) ** -0.5)) if curvature < 0.0 else (0.0, 0.0)


def likeliest_lag(likelihood: Array) -> tuple[float, float]:
    """Return the likeliest of lags that are even about 0, and its standard deviation, in cells."""
    at = int(likelihood.argmax())
    beyond, error = peak(likelihood, at)
    return at - likelihood.size // 2 + beyond, error


class Alignment(NamedTuple):
    """Delay of the inputs, and assignment of the fins.

    Attributes
    ----------
    delay : float or None
        How much later than the motion they are stamped, s; None where nothing tells.
    exchanged : bool or None
        Whether what is called rudder turns the vehicle as an elevator does, and the other way round.
    share : float
        By how much the faster of the fins changes within the delay, of its RMS about its mean.
    usual : float
        Delay, s, that there seems to be where there is none.
    error : float
        Standard deviation of the delay, s, as far as noise goes.
    is_clear : bool
        Whether no delay beyond the usual is likelier than this one, by however little.
    gain : float
        In log-likelihood, over no delay.
    """

    delay: float | None
    exchanged: bool | None
    share: float = 0.0
    usual: float = _UNKNOWN
    error: float = 0.0
    is_clear: bool = True
    gain: float = 0.0

    @property
    def is_delayed(self) -> bool:
        """Say whether inputs come later or earlier than what is left of a lag in sound data."""
        return self.delay is not None and abs(self.delay) - _SIGMAS * self.error > self.usual

    @property
    def spoils(self) -> bool:
        """Say whether that makes coefficients of the fins wrong."""
        return (
            self.delay is not None and self.is_delayed and self.share > _MATTERS and not -_EARLIEST <= self.delay < 0.0
        )


def input_alignment(signals: Signals, motion: SmallMotion | None, time_constant: float | None) -> Alignment:
    """Find the assignment of the fins and the one delay of all inputs that explain the turning best.

    Whatever is regressed here, signs do not count: they are judged when the inputs are where they belong.

    Parameters
    ----------
    signals : Signals
    motion : SmallMotion or None
        Of the vehicle file, if it says enough: then the delay between an input and its answer that the vehicle itself
        makes is none.
    time_constant : float or None
        s, of the vehicle, if it is known.
    """
    roll, *fins = AXES
    crossed_fins = [axis._replace(given=_OTHER_FIN[axis.given]) for axis in fins]
    by_roll, as_named, crossed = (
        _input_likelihood(signals, axes, motion, time_constant) for axes in ([roll], fins, crossed_fins)
    )
    best = max(as_named.correlation, crossed.correlation, by_roll.correlation)
    if motion is None:
        most = _UNKNOWN
    else:
        most = max(_PROMISED, _OF_TIME_CONSTANT * (time_constant or 0.0)) if best >= _AS_PROMISED else _INPUT_OTHERWISE
    as_named, crossed = (each.of_lags + by_roll.of_lags for each in (as_named, crossed))
    if not max(as_named.max(), crossed.max()) > 0.0:
        return Alignment(None, None)
    exchanged = bool(crossed.max() > as_named.max() + _INPUT_LIKELIER)
    likelihood, delays = crossed if exchanged else as_named, _lags(signals)
    usual = np.abs(delays) * signals.grid.step <= most + 0.5 * signals.grid.step
    likeliest = int(likelihood.argmax())
    is_clear = bool(usual[likeliest] or likelihood[likeliest] > likelihood[usual].max() + _INPUT_LIKELIER)
    if not is_clear:
        likeliest = int(np.where(usual, likelihood, -np.inf).argmax())
    beyond, error = peak(likelihood, likeliest)
    cells = float(delays[likeliest]) + beyond
    gain = float(likelihood[likeliest] - likelihood[delays.size // 2])
    share = _share(signals, cells)
    return Alignment(cells * signals.grid.step, exchanged, share, most, error * signals.grid.step, is_clear, gain)


def _share(signals: Signals, cells: float) -> float:
    """Return by how much of its RMS about its mean the faster fin changes within so many cells."""
    shares, whole = [0.0], max(round(abs(cells)), 1)
    for fin in _OTHER_FIN:
        deflection = signals.values[fin]
        if (spread := float(np.nanstd(deflection))) > LEAST_DEFLECTION:
            changes = float(np.sqrt(np.nanmean(np.square(shifted(deflection, whole) - deflection))))
            shares.append(changes / spread * min(abs(cells) / whole, 1.0))
    return max(shares)


def aligned(signals: Signals, alignment: Alignment) -> Signals:
    """Put the inputs of signals where they belong."""
    value = dict(signals.values)
    if alignment.exchanged:
        value["rudder"], value["elevator"] = value["elevator"], value["rudder"]
    if alignment.is_delayed and alignment.delay is not None:
        cells = round(alignment.delay / signals.grid.step)
        for symbol in INPUT_SYMBOLS:
            value[symbol] = shifted(value[symbol], cells)
    return signals._replace(values=value)


def alignment_checks(alignment: Alignment) -> list[Check]:
    """Judge the delay of the inputs and which fin is which."""
    assignment = "r answers rudder, q elevator"
    delay_limit = (
        f"<= {alignment.usual:.2g} s; fails if a fin changes by {_MATTERS:.0%} in more, or {_EARLIEST:g} s early"
    )
    if alignment.delay is None or alignment.exchanged is None:
        reason = "no turning answers an input"
        return [
            cannot_tell("inputs", "delay", reason, delay_limit),
            cannot_tell("inputs", "rudder and elevator", reason, assignment),
        ]
    delay = alignment.delay
    if delay >= 0.0:
        late, why = f"lag behind the motion by {delay:.2f} s", "What comes after its answer spoils coefficients of fins"
    else:
        late = f"are {-delay:.2f} s ahead of the motion"
        why = "Fins follow late (`vehicle.actuators.fins.time_constant`), or the clock of their commands is ahead"
    unclear = "" if alignment.is_clear else "cannot tell from a longer lag: "
    return [
        judged(
            "inputs",
            "delay",
            statistic=f"{unclear}inputs {late}, in which a fin changes by {alignment.share:.0%}",
            threshold=delay_limit,
            passed=_verdict(alignment),
            advice=f"{why}: state it (`identification.delays={{inputs: {-delay:.2g} s}}`), or shift the times; inputs "
            "of which only samples are recorded seem half an interval late (`identification.inputs.between: linear`). "
            "Signs were judged as if they were shifted.",
        ),
        judged(
            "inputs",
            "rudder and elevator",
            statistic="r answers elevator, q rudder" if alignment.exchanged else assignment,
            threshold=assignment,
            passed=not alignment.exchanged,
            advice="The columns of rudder and elevator are exchanged: exchange their names in the map. Signs were "
            "judged as if they were.",
        ),
    ]


def _verdict(alignment: Alignment) -> bool | None:
    if not alignment.is_clear or (alignment.is_delayed and not alignment.spoils):
        return None
    return not alignment.is_delayed


class _Likelihood(NamedTuple):
    """How much likelier some answers are than none, as a logarithm, for each of the `_lags`; the best correlation."""

    of_lags: Array
    correlation: float


def _input_likelihood(
    signals: Signals, axes: Sequence[RotationAxis], motion: SmallMotion | None, time_constant: float | None
) -> _Likelihood:
    total, best = np.zeros(_lags(signals).size), 0.0
    for axis in axes:
        correlation, windows = _correlations(signals, axis, motion, time_constant)
        best = max(best, float(np.abs(correlation).max()))
        if np.abs(correlation).max() >= _LEAST_INPUT_CORRELATION:
            total -= 0.5 * windows * np.log1p(-np.minimum(correlation**2, _MOST_EXPLAINED))
    return _Likelihood(total, best)


def _correlations(
    signals: Signals, axis: RotationAxis, motion: SmallMotion | None, time_constant: float | None
) -> tuple[Array, float]:
    """Correlate, in part, the change of a rate and what an input that was stamped so much later makes of it.

    Returns
    -------
    correlation : ndarray
        For each of the `_lags`; 0 where nothing can be told.
    windows : float
        How many averages do not overlap.
    """
    lags = _lags(signals)
    answer = promised_answer(signals, axis, motion, answer_window(signals, axis, time_constant))
    if answer is None:
        return np.zeros(lags.size), 0.0
    rows = np.stack([answer.change, *answer.beside])
    # Known at every lag.
    complete = np.isfinite(rows).all(axis=0)
    complete &= np.isfinite(shifted(smoothed(answer.promised, lags.size), int(lags[0])))
    at = np.flatnonzero(complete)
    windows = at.size / answer.window
    if windows < _FEWEST_WINDOWS:
        return np.zeros(lags.size), 0.0
    at = at[:: 1 + at.size // _MOST_ROWS]
    beside = np.stack([np.ones(at.size), *rows[1:, at]], axis=1)
    basis, _ = np.linalg.qr(beside / np.maximum(np.abs(beside).max(axis=0), np.finfo(np.float64).tiny))
    changed = _left(rows[0, at], basis)
    return np.array([changed @ _left(answer.promised[at + lag], basis) for lag in lags]), windows


def _left(values: Array, basis: Array) -> Array:
    """Return what is left of a signal outside an orthonormal basis, of length 1; 0 if that is rounding."""
    left = values - basis @ (basis.T @ values)
    length = float(np.linalg.norm(left))
    return left / length if length > _ROUNDING * float(np.linalg.norm(values)) else 0.0 * left


def _lags(signals: Signals) -> NDArray[np.int64]:
    """Return the cells by which the inputs may be late."""
    most = round(_LONGEST_INPUT_DELAY / signals.grid.step)
    return np.arange(-most, most + 1)


class _Pair(NamedTuple):
    """What a sensor says, and what others make of it, both smoothed over as long.

    Attributes
    ----------
    sensor, other : str
    measured, expected : ndarray
    turned : mapping of ndarray
        What others make of it if the sign of one of them, whose symbol it is, is turned: that looks like a delay.
    swings : bool
        Whether a sensor that sits ahead or aft of the other looks late.
    """

    sensor: str
    other: str
    measured: Array
    expected: Array
    turned: Mapping[str, Array] = MappingProxyType({})
    swings: bool = False


def sensor_delay_checks(signals: Signals, time_constant: float | None, contradicted: bool) -> list[Check]:
    """Judge how much later than others each sensor is stamped, where signals agree well enough to tell it.

    Parameters
    ----------
    signals : Signals
    time_constant : float or None
        s, of the vehicle, if it is known.
    contradicted : bool
        Whether rates and angles contradict each other: then only their own delay is judged.
    """
    window = attitude_window(signals)
    by_sensors: dict[tuple[str, str], list[_Pair]] = {}
    for pair in _pairs(signals, window // 2):
        if contradicted and pair.sensor != "gyroscope":
            continue
        by_sensors.setdefault((pair.sensor, pair.other), []).append(pair)
    # A DVL ahead of the accelerometer swings like one that is late: of these two a lag is only noted, unless surge,
    # which does not swing, tells one by itself.
    surge = [pair for pair in by_sensors.get(("dvl", "accelerometer"), ()) if not pair.swings]
    lag = _lag(signals, surge, window)
    late = lag is not None and lag.beyond > _LARGEST
    largest = {"depth": _LARGEST + _AFT * (time_constant or 0.0), "dvl": _LARGEST if late else np.inf}
    checks = (
        _check(signals, sensor, other, pairs, window, largest.get(sensor, _LARGEST))
        for (sensor, other), pairs in by_sensors.items()
    )
    return [check for check in checks if check is not None]


def _pairs(signals: Signals, half: int) -> Iterator[_Pair]:
    step, value = signals.grid.step, signals.values
    for rate, relation in attitude_rates(signals).items():
        if signals.has(rate):
            yield _Pair("gyroscope", "attitude", response_to_rates(value[rate], step, half), relation.total())
    dive = diving_speed(signals)
    if dive is not None and signals.has("down", "w"):
        measured = rate_of_change(value["down"], step, half)
        stated, turned = (response_to_rates(dive.total() - 2.0 * by * dive.others[0], step, half) for by in (0.0, 1.0))
        yield _Pair("depth", "attitude", measured, stated, {"w": turned})
    for velocity, force in measured_forces(signals).items():
        # What is left of the specific force beside gravity and the turning is the change of a velocity.
        left = value[f"f{'xyz'['uvw'.index(velocity)]}"] - sum(force.others)
        changing = rate_of_change(value[velocity], step, half)
        yield _Pair("dvl", "accelerometer", changing, response_to_rates(left, step, half), swings=velocity != "u")


class _Lag(NamedTuple):
    """How much later what a sensor measures is than what is expected, and its standard deviation, s.

    Attributes
    ----------
    size, error : float
    turned : list of str
        Symbols of the signs that seem turned.
    """

    size: float
    error: float
    turned: list[str]

    @property
    def beyond(self) -> float:
        """Return how long it is at least, s."""
        return abs(self.size) - 2.0 * self.error


def _lag(signals: Signals, pairs: Sequence[_Pair], window: int) -> _Lag | None:
    """Find the one lag that pairs of signals have together; None where they hardly agree."""
    lags = np.arange(
        -round(_LONGEST_SENSOR_DELAY / signals.grid.step), round(_LONGEST_SENSOR_DELAY / signals.grid.step) + 1
    )
    usual = np.abs(lags) * signals.grid.step <= _USUAL
    likelihood, turned = np.zeros(lags.size), list[str]()
    for pair in pairs:
        best = _sensor_likelihood(pair.measured, pair.expected, lags, window)
        for symbol, expected in pair.turned.items():
            other_way = _sensor_likelihood(pair.measured, expected, lags, window)
            if other_way[usual].max() > best.max() + _SENSOR_LIKELIER:
                best = other_way
                turned.append(symbol)
        likelihood += best
    if not likelihood.any():
        return None
    cells, error = likeliest_lag(likelihood)
    return _Lag(cells * signals.grid.step, error * signals.grid.step, turned)


def _check(signals: Signals, sensor: str, other: str, pairs: list[_Pair], window: int, largest: float) -> Check | None:
    lag = _lag(signals, pairs, window)
    if lag is None:
        return None
    late, early = (sensor, other) if lag.size > 0.0 else (other, sensor)
    return judged(
        sensor,
        f"delay against {other}",
        statistic=f"{late} is {abs(lag.size):.2f} +- {lag.error:.1g} s later than {early}"
        + (f", if the sign of {', '.join(lag.turned)} is turned, as it seems" if lag.turned else ""),
        threshold=f"<= {_USUAL:g} s" + (f"; fails beyond {largest:.2g} s" if np.isfinite(largest) else ""),
        passed=False if lag.beyond > largest else None if lag.beyond > _USUAL else True,
        advice=f"{late} is stamped late, or {early} early: shift the times, state it (`identification.delays`), or let "
        "it be found (`identification.estimate.biases: [delay]`)." + _SENSOR_OTHERWISE.get(sensor, ""),
    )


def _sensor_likelihood(measured: Array, expected: Array, lags: NDArray[np.int64], window: int) -> Array:
    """Say for each lag how much likelier the signals are together than apart, as a logarithm; 0 if they hardly agree.

    What is measured so many cells later is correlated with what is expected, at cells that are known at every lag.
    """
    rows = np.stack([shifted(measured, int(lag)) for lag in lags])
    complete = np.isfinite(rows).all(axis=0) & np.isfinite(expected)
    windows = int(complete.sum()) / window
    if windows < _FEWEST:
        return np.zeros(lags.size)
    rows, expected = rows[:, complete], expected[complete]
    rows, expected = rows - rows.mean(axis=1, keepdims=True), expected - expected.mean()
    sizes = np.linalg.norm(rows, axis=1) * np.linalg.norm(expected)
    correlations = np.divide(rows @ expected, sizes, out=np.zeros(lags.size), where=sizes > 0.0)
    if correlations.max() < _LEAST_SENSOR_CORRELATION:
        return np.zeros(lags.size)
    return -0.5 * windows * np.log1p(-(np.clip(correlations, 0.0, 1.0 - 1e-9) ** 2))
