"""Kinematic relations between signals of a log, and responses to fins: correlation, gain and delay.

Signs, units and axes of these signals may be wrong, so each relation connects few of them and needs no cosine of an
angle. `auvid_cli.inspection.kinematic_relations` has the complete relations, for signals in SI.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from auvid_cli.arrays import Array
from auvid_cli.logs.frames import interpolate
from auvid_cli.vehicle.rigid_body import GRAVITY

_STEP = 0.1  # s, of the common time grid
_MAX_CELLS = 20_000  # cells of the grid
_MAX_ROWS = 4_000  # rows of a correlation
_WINDOW = 0.6  # s, over which rates of angles are taken
_MAX_DELAY = 1.0  # s
_RESPONSE_TIMES = (1.0, 2.0)  # s after which the response to a fin is measured
_LONG_WINDOW = 4.0  # s, for a rate that oscillates too much for `_RESPONSE_TIMES`
ANGLES = ("phi", "theta", "psi")
_MIN_WINDOWS = 12  # independent windows that a correlation needs
_MIN_CORRELATION = 0.3
_MAX_WEIGHT = 12.0
# Sideslip depends on where the DVL is mounted, and feedback of an autopilot confounds responses: these weigh less.
_SIDESLIP_WEIGHT = 1.5
_SIDESLIP_CORRELATION = 0.5
_CONFOUNDED_WEIGHT = 3.5
# A current shows in surge and sway of several headings; it must explain much of the surge that turns leave.
_CURRENT_WEIGHT = 6.0
_CURRENT_WINDOW = 10.0  # s, of a steady heading
_MIN_CURRENT_SHARE = 0.3  # share of the variance of the surge
_MIN_HEADINGS = 0.05  # smallest variance of the heading's cosine and sine along any direction
# A delay counts only if the signals agree well and its likelihood clearly exceeds that of no delay (log likelihoods).
_DELAY_GAIN = 6.0
_DELAY_COST = 8.0  # per second
_DELAY_CORRELATION = 0.8
YAW_FINS = ("rudder", "fins.top", "fins.bottom")
PITCH_FINS = ("elevator", "fins.right", "fins.left")
CROSSED = "crossed"  # marks responses that only exchanged fins would have


class Track(NamedTuple):
    """A signal at increasing times, s; in SI if its unit is known."""

    time: Array
    values: Array


class RelationFit(NamedTuple):
    """Agreement of a signal with the prediction from others."""

    symbols: tuple[str, ...]  # signals whose signs the relation connects
    words: str
    correlation: float
    gain: float  # ratio of the signal to its prediction; 1 if the units are right
    weight: float  # log likelihood of equal signs
    delay: float  # s, by which the first signal is late; NaN if no delay is significant


class Relation(NamedTuple):
    """Signals on the grid that should be equal, apart from a linear effect of the covariates."""

    symbols: tuple[str, ...]
    words: str
    signal: Array
    prediction: Array
    covariates: tuple[Array, ...] = ()
    max_weight: float = _MAX_WEIGHT
    window: float = _WINDOW
    shows_delay: bool = True


def fit_relations(tracks: Mapping[str, Track]) -> list[RelationFit]:
    """Fit all relations between the signals that a log has.

    Parameters
    ----------
    tracks : mapping of str to Track
        Signals by symbol of the component; fins by ``rudder``, ``elevator``, or ``fins.top`` and so on.
    """
    signals = on_grid(tracks)
    fits: dict[str, RelationFit] = {}
    if signals is None:
        return []
    for relation in _relations(signals):
        fit = fit_relation(relation, signals.step)
        # A response is measured over several windows; the one with the most evidence counts.
        if fit is not None and (fit.words not in fits or abs(fits[fit.words].weight) < abs(fit.weight)):
            fits[fit.words] = fit
    return [*fits.values()]


def on_grid(tracks: Mapping[str, Track], are_unwrapped: bool = False) -> "Signals | None":
    """Return signals, whose angles may be unwrapped already, on one grid of times; None if they are too short."""
    if not tracks:
        return None
    # Medians, because one sensor's clock may be days away.
    begin, end = (float(np.median([track.time[k] for track in tracks.values()])) for k in (0, -1))
    step = max(_STEP, (end - begin) / _MAX_CELLS)
    grid = np.arange(begin, end + 0.5 * step, step)
    if grid.size < _MIN_WINDOWS:
        return None
    wrapped = () if are_unwrapped else ANGLES
    values = {
        symbol: interpolate(track.time, track.values[:, None], grid, is_angle=symbol in wrapped)[:, 0]
        for symbol, track in tracks.items()
    }
    return Signals(values, step)


class Signals:
    """Signals on one grid of times, their moving means and rates of change."""

    def __init__(self, values: Mapping[str, Array], step: float) -> None:
        self.values, self.step = values, step
        self._cells = _even_cells(_WINDOW, step)

    def has(self, *symbols: str) -> bool:
        """Whether the log has all these symbols."""
        return {*symbols} <= {*self.values}

    def mean(self, symbol: str) -> Array:
        """Return the moving mean."""
        return _mean(self.values[symbol], self._cells)

    def rate(self, symbol: str) -> Array:
        """Return the rate of change."""
        return _change(self.values[symbol], self._cells) / (self._cells * self.step)

    def change(self, values: Array, window: float) -> Array:
        """Return the change of values on the grid over a time, s."""
        return _change(values, _even_cells(window, self.step))

    def means(self, *symbols: str) -> tuple[Array, ...]:
        """Return the moving means of those symbols that the log has."""
        return tuple(self.mean(symbol) for symbol in symbols if symbol in self.values)

    def course(self) -> tuple[Array, ...]:
        """Return cosine and sine of the heading; the effect of a current on a velocity is a combination of both."""
        return (np.cos(self.values["psi"]), np.sin(self.values["psi"])) if "psi" in self.values else ()

    def turning(self, symbol: str, angle: str) -> tuple[str, Array] | None:
        """Return the symbol that has the sign of a turn rate, and the rate: measured, or that of the angle."""
        if symbol in self.values:
            return symbol, self.mean(symbol)
        return (angle, self.rate(angle)) if angle in self.values else None


def _relations(s: Signals) -> Iterator[Relation]:
    for symbol, angle in (("p", "phi"), ("q", "theta"), ("r", "psi")):
        if s.has(symbol, angle):
            yield Relation((symbol, angle), f"{symbol} is the rate of {angle}", s.mean(symbol), s.rate(angle))
    yield from _of_depth(s)
    yield from _of_acceleration(s)
    turn = s.turning("r", "psi")
    if turn is not None:
        axis, rate = turn
        if s.has("v"):
            words, limit = "v points outward in turns", _SIDESLIP_WEIGHT
            yield Relation(("v", axis), words, s.mean("v"), -rate, s.course(), max_weight=limit, shows_delay=False)
            yield from _of_current(s, rate)
        yield from _responses(s, axis, rate, YAW_FINS)
    pitching = s.turning("q", "theta")
    if pitching is not None:
        yield from _responses(s, *pitching, PITCH_FINS)


def _of_current(s: Signals, turn_rate: Array) -> Iterator[Relation]:
    """Yield the relation of sway to the current that surge shows, if the headings are enough for one."""
    if not s.has("u", "psi"):
        return
    cosine, sine = s.course()
    rows = np.stack([s.mean("u"), cosine, sine, np.abs(turn_rate), np.ones(cosine.size)])
    rows = rows[:, np.isfinite(rows).all(axis=0)]
    if rows.shape[1] < _MIN_WINDOWS:
        return
    basis, _ = np.linalg.qr(rows[3:].T)
    rest = rows[:3] - (rows[:3] @ basis) @ basis.T
    covariance = np.cov(rest[1:])
    if float(np.linalg.eigvalsh(covariance)[0]) < _MIN_HEADINGS:
        return
    (north, east), *_ = np.linalg.lstsq(rest[1:].T, rest[0], rcond=None)
    if np.var(north * rest[1] + east * rest[2]) < _MIN_CURRENT_SHARE * np.var(rest[0]):
        return
    aside = east * cosine - north * sine
    words, limit = "v shows the current that u shows", _CURRENT_WEIGHT
    yield Relation(
        ("v", "u", "psi"), words, s.mean("v"), aside, (turn_rate,), limit, _CURRENT_WINDOW, shows_delay=False
    )


def _of_depth(s: Signals) -> Iterator[Relation]:
    if not s.has("down"):
        return
    diving: tuple[Array, ...] = ()
    if s.has("theta"):
        ahead = ("u",) if s.has("u") else ()
        speed = s.mean("u") if ahead else 1.0
        diving = (-speed * np.sin(s.mean("theta")),)
        symbols, words = ("down", *ahead, "theta"), "depth changes with pitch"
        # Without heave, the path of a vehicle lags behind its pitch.
        yield Relation(symbols, words, s.rate("down"), diving[0], s.means("w"), shows_delay=s.has("w"))
    if s.has("w"):
        words = "w is the rate of depth"
        yield Relation(("w", "down"), words, s.mean("w"), s.rate("down"), diving, shows_delay=False)


def _of_acceleration(s: Signals) -> Iterator[Relation]:
    if s.has("fx", "theta"):
        gravity, covariates = GRAVITY * np.sin(s.mean("theta")), (s.rate("u"),) if s.has("u") else ()
        yield Relation(("fx", "theta"), "fx contains gravity due to pitch", s.mean("fx"), gravity, covariates)
    if s.has("fx", "u"):
        yield Relation(("fx", "u"), "fx is the rate of u", s.mean("fx"), s.rate("u"), s.means("theta"))
    turn = s.turning("r", "psi")
    if s.has("fy", "phi"):
        gravity, covariates = -GRAVITY * np.sin(s.mean("phi")), (turn[1],) if turn is not None else ()
        yield Relation(("fy", "phi"), "fy contains gravity due to roll", s.mean("fy"), gravity, covariates)
    if s.has("fy", "u") and turn is not None:
        symbols, words = ("fy", "u", turn[0]), "fy is centripetal in turns"
        force, limit = s.mean("u") * turn[1], _CONFOUNDED_WEIGHT
        yield Relation(symbols, words, s.mean("fy"), force, s.means("phi"), max_weight=limit, shows_delay=False)


def _responses(s: Signals, axis: str, rate: Array, fins: Sequence[str]) -> Iterator[Relation]:
    """Yield the responses of a rate to its own fins, and to the other fins as crossed."""
    for fin in (*YAW_FINS, *PITCH_FINS):
        if fin not in s.values:
            continue
        symbols = (axis, fin) if fin in fins else (axis, fin, CROSSED)
        name = fin.removeprefix("fins.")
        for window in _RESPONSE_TIMES:
            cells, words = _even_cells(window, s.step), f"{axis} responds to {name}"
            change, moment = _change(rate, cells), -_mean(s.values[fin], cells)
            yield Relation(symbols, words, change, moment, (rate,), window=window, shows_delay=False)
        cells, words = _even_cells(_LONG_WINDOW, s.step), f"{axis} follows {name}"
        mean, moment, limit = _mean(rate, cells), -_mean(s.values[fin], cells), _CONFOUNDED_WEIGHT
        yield Relation(symbols, words, mean, moment, max_weight=limit, window=_LONG_WINDOW, shows_delay=False)


def fit_relation(relation: Relation, step: float) -> RelationFit | None:
    """Fit a relation on a grid with a `step`, s; None if too few rows have numbers."""
    best, delay = _correlation(relation, 0), float("nan")
    if best is None or (n_windows := best.rows * step / relation.window) < _MIN_WINDOWS:
        return None
    if relation.shows_delay:
        lags = np.arange(-round(_MAX_DELAY / step), round(_MAX_DELAY / step) + 1)
        shifted = [_correlation(relation, int(lag)) for lag in lags]
        sizes = np.array([0.0 if one is None else abs(one.correlation) for one in shifted])
        # A periodic signal agrees with itself at many lags; the smaller ones are more likely.
        score = np.array([_log_likelihood(size, n_windows) for size in sizes]) - _DELAY_COST * step * np.abs(lags)
        at = int(score.argmax())
        if 0 < at < lags.size - 1 and sizes[at] > _DELAY_CORRELATION and score[at] > score[lags == 0] + _DELAY_GAIN:
            left, middle, right = sizes[at - 1 : at + 2]
            delay = float(step * (lags[at] + 0.5 * (left - right) / (left - 2.0 * middle + right)))
            best = shifted[at] or best
    size = abs(best.correlation)
    threshold = _MIN_CORRELATION if relation.max_weight > _SIDESLIP_WEIGHT else _SIDESLIP_CORRELATION
    weight = 0.0 if size < threshold else min(relation.max_weight, _log_likelihood(size, n_windows))
    signed = float(np.copysign(weight, best.correlation))
    return RelationFit(relation.symbols, relation.words, best.correlation, best.gain, signed, delay)


class _Correlation(NamedTuple):
    correlation: float
    gain: float
    rows: int


def _correlation(relation: Relation, lag: int) -> _Correlation | None:
    """Return the partial correlation given the covariates; the signal is taken `lag` cells later."""
    rows = np.stack([_shifted(relation.signal, lag), relation.prediction, *relation.covariates])
    rows = rows[:, np.isfinite(rows).all(axis=0)]
    number = rows.shape[1]
    rows = rows[:, :: 1 + number // _MAX_ROWS]
    if rows.shape[1] <= 2 + len(relation.covariates):
        return None
    covariates = np.stack([np.ones(rows.shape[1]), *rows[2:]], axis=1)
    size = np.maximum(np.abs(covariates).max(axis=0), np.finfo(np.float64).tiny)
    basis, _ = np.linalg.qr(covariates / size)
    residuals = rows[:2] - (rows[:2] @ basis) @ basis.T
    lengths = np.linalg.norm(residuals, axis=1)
    # A signal that is constant, or a combination of the covariates, leaves only rounding.
    if not (lengths > 1e-9 * np.linalg.norm(rows[:2], axis=1)).all():
        return None
    correlation = float(residuals[0] @ residuals[1] / (lengths[0] * lengths[1]))
    return _Correlation(correlation, float(lengths[0] / lengths[1]), number)


def _log_likelihood(correlation: float, n_windows: float) -> float:
    return float(-0.5 * n_windows * np.log1p(-min(correlation**2, 0.99)))


def _shifted(values: Array, cells: int) -> Array:
    lost = np.full(abs(cells), np.nan)
    return np.concatenate([values[cells:], lost] if cells >= 0 else [lost, values[:cells]])


def _mean(values: Array, cells: int) -> Array:
    """Return the centred moving mean over an even number of cells."""
    if values.size <= cells:
        return np.full(values.size, np.nan)
    inside = np.convolve(values, np.full(cells + 1, 1.0 / (cells + 1)), "valid")
    return np.pad(inside, cells // 2, constant_values=np.nan)


def _change(values: Array, cells: int) -> Array:
    """Return the centred change over an even number of cells."""
    if values.size <= cells:
        return np.full(values.size, np.nan)
    return np.pad(values[cells:] - values[:-cells], cells // 2, constant_values=np.nan)


def integral(rate: Array, step: float) -> Array:
    """Return the integral of a rate over a grid; missing rates count as zero, and their times have no value."""
    known = np.isfinite(rate)
    return np.where(known, step * np.cumsum(np.where(known, rate, 0.0)), np.nan)


def _even_cells(window: float, step: float) -> int:
    """Return the even number of cells nearest to a time, s."""
    return 2 * max(1, round(0.5 * window / step))
