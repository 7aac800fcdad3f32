"""What signals of a log should be to each other by kinematics and by the answer to fins: how well, and how late."""

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.logs.frames import interpolate
from auvid_cli.vehicle.kinematics import GRAVITY

Array = NDArray[np.float64]

# s and number of cells of the times that signals are put on, and how many are compared.
_STEP, _MOST_CELLS, _MOST_ROWS = 0.1, 20_000, 4_000
# s over which rates of angles are taken.
_WINDOW = 0.6
# s: how much later one may be; over which a fin is answered.
_LATEST, _ANSWERS, _LONG = 1.0, (1.0, 2.0), 4.0
_ANGLES = ("phi", "theta", "psi")
# Correlations that tell nothing and almost nothing; independent windows that are needed; and what a tie may weigh.
_LEAST, _FEWEST, _MOST = 0.3, 12, 12.0
# A vehicle may slide to either side of where its DVL turns, and closed loops confound what answers what.
_DOUBTFUL, _LEAST_DOUBTFUL, _CONFOUNDED = 1.5, 0.5, 3.5
# By how much a delay must be likelier than none, as a logarithm, what each second of it costs, and how well signals
# must agree then: what is left out between them may lag as well.
_LIKELIER, _PER_SECOND, _AGREED = 6.0, 8.0, 0.8


class Track(NamedTuple):
    """A signal in SI, as far as its unit is known, at increasing times, s."""

    time: Array
    values: Array


class Agreement(NamedTuple):
    """How one signal agrees with what another one makes of it.

    Attributes
    ----------
    symbols : tuple of str
        Whose signs it ties together.
    words : str
    correlation : float
    gain : float
        Size of the first by that of the other; 1 if units are right.
    weight : float
        Log likelihood that speaks for equal signs.
    delay : float
        s, by which the first is late; NaN if none is surely better than none at all.
    """

    symbols: tuple[str, ...]
    words: str
    correlation: float
    gain: float
    weight: float
    delay: float


class _Pair(NamedTuple):
    """Signals that should be equal but for what stands beside them."""

    symbols: tuple[str, ...]
    words: str
    first: Array
    other: Array
    beside: tuple[Array, ...] = ()
    most: float = _MOST
    window: float = _WINDOW
    tells_delay: bool = True


def find_ties(tracks: Mapping[str, Track]) -> list[Agreement]:
    """Compare all signals that have to do with each other.

    Parameters
    ----------
    tracks : mapping of str to Track
        By symbol of the component; fins by rudder, elevator, or fins.top and the like.
    """
    if not tracks:
        return []
    # A clock of its own, days away, is no reason to look at nothing between.
    begin, end = (float(np.median([track.time[k] for track in tracks.values()])) for k in (0, -1))
    step = max(_STEP, (end - begin) / _MOST_CELLS)
    grid = np.arange(begin, end + 0.5 * step, step)
    if grid.size < _FEWEST:
        return []
    on = {
        symbol: interpolate(track.time, track.values[:, None], grid, is_angle=symbol in _ANGLES)[:, 0]
        for symbol, track in tracks.items()
    }
    found: dict[str, Agreement] = {}
    for pair in _pairs(_Signals(on, step)):
        tie = _compare(pair, step)
        # Of an answer, over as long as tells most.
        if tie is not None and (pair.words not in found or abs(found[pair.words].weight) < abs(tie.weight)):
            found[pair.words] = tie
    return [*found.values()]


class _Signals:
    """Signals on one grid of times, smoothed over a while, and their rates of change over it."""

    def __init__(self, on: Mapping[str, Array], step: float) -> None:
        self.on, self.step = on, step
        self._cells = _even(_WINDOW, step)

    def has(self, *symbols: str) -> bool:
        """Say whether all of some signals are there."""
        return {*symbols} <= {*self.on}

    def mean(self, symbol: str) -> Array:
        """Return a signal, smoothed."""
        return _mean(self.on[symbol], self._cells)

    def rate(self, symbol: str) -> Array:
        """Return the change of a signal per second."""
        return _change(self.on[symbol], self._cells) / (self._cells * self.step)

    def beside(self, *symbols: str) -> tuple[Array, ...]:
        """Return those of some signals that are there, smoothed."""
        return tuple(self.mean(symbol) for symbol in symbols if symbol in self.on)

    def course(self) -> tuple[Array, ...]:
        """Return what a current adds to a velocity over ground goes with, if there is a heading."""
        return (np.cos(self.on["psi"]), np.sin(self.on["psi"])) if "psi" in self.on else ()

    def turning(self, symbol: str, angle: str) -> tuple[str, Array] | None:
        """Return a rate, by its sensor or by the change of the angle, with the symbol whose sign it has."""
        if symbol in self.on:
            return symbol, self.mean(symbol)
        return (angle, self.rate(angle)) if angle in self.on else None


def _pairs(s: _Signals) -> Iterator[_Pair]:
    for symbol, angle in (("p", "phi"), ("q", "theta"), ("r", "psi")):
        if s.has(symbol, angle):
            yield _Pair((symbol, angle), f"{symbol} is the change of {angle}", s.mean(symbol), s.rate(angle))
    yield from _of_depth(s)
    yield from _of_acceleration(s)
    turn = s.turning("r", "psi")
    if turn is not None:
        axis, rate = turn
        if s.has("v"):
            words = "v slides outward in a turn"
            yield _Pair(("v", axis), words, s.mean("v"), -rate, s.course(), most=_DOUBTFUL, tells_delay=False)
        yield from _answers(s, axis, rate, TURNING)
    pitching = s.turning("q", "theta")
    if pitching is not None:
        yield from _answers(s, *pitching, PITCHING)


def _of_depth(s: _Signals) -> Iterator[_Pair]:
    if not s.has("down"):
        return
    diving: tuple[Array, ...] = ()
    if s.has("theta"):
        ahead = ("u",) if s.has("u") else ()
        speed = s.mean("u") if ahead else 1.0
        diving = (-speed * np.sin(s.mean("theta")),)
        symbols, words = ("down", *ahead, "theta"), "depth changes with pitch"
        # Without heave the path of a vehicle lags behind its pitch.
        yield _Pair(symbols, words, s.rate("down"), diving[0], s.beside("w"), tells_delay=s.has("w"))
    if s.has("w"):
        words = "w is the change of depth"
        yield _Pair(("w", "down"), words, s.mean("w"), s.rate("down"), diving, tells_delay=False)


def _of_acceleration(s: _Signals) -> Iterator[_Pair]:
    if s.has("fx", "theta"):
        pull, beside = GRAVITY * np.sin(s.mean("theta")), (s.rate("u"),) if s.has("u") else ()
        yield _Pair(("fx", "theta"), "fx feels gravity by pitch", s.mean("fx"), pull, beside)
    if s.has("fx", "u"):
        yield _Pair(("fx", "u"), "fx is the change of u", s.mean("fx"), s.rate("u"), s.beside("theta"))
    turn = s.turning("r", "psi")
    if s.has("fy", "phi"):
        pull, beside = -GRAVITY * np.sin(s.mean("phi")), (turn[1],) if turn is not None else ()
        yield _Pair(("fy", "phi"), "fy feels gravity by roll", s.mean("fy"), pull, beside)
    if s.has("fy", "u") and turn is not None:
        words, push = "fy holds the vehicle in a turn", s.mean("u") * turn[1]
        yield _Pair(
            ("fy", "u", turn[0]), words, s.mean("fy"), push, s.beside("phi"), most=_CONFOUNDED, tells_delay=False
        )


def _answers(s: _Signals, axis: str, rate: Array, fins: Sequence[str]) -> Iterator[_Pair]:
    """Yield what fins do to a rate: those that should, and as crossed those that should not."""
    for fin in (*TURNING, *PITCHING):
        if fin not in s.on:
            continue
        symbols, called = (axis, fin) if fin in fins else (axis, fin, CROSSED), fin.removeprefix("fins.")
        for window in _ANSWERS:
            cells = _even(window, s.step)
            changed, moment = _change(rate, cells), -_mean(s.on[fin], cells)
            yield _Pair(symbols, f"{axis} answers {called}", changed, moment, (rate,), window=window, tells_delay=False)
        # Where a heading swings too much for that; an autopilot confounds it.
        cells, words = _even(_LONG, s.step), f"{axis} goes with {called}"
        turned, moment = _mean(rate, cells), -_mean(s.on[fin], cells)
        yield _Pair(symbols, words, turned, moment, most=_CONFOUNDED, window=_LONG, tells_delay=False)


# Fins that turn and that pitch the vehicle, and the mark of ties that only exchanged ones would have.
TURNING, PITCHING = ("rudder", "fins.top", "fins.bottom"), ("elevator", "fins.right", "fins.left")
CROSSED = "crossed"


def _compare(pair: _Pair, step: float) -> Agreement | None:
    now = _correlation(pair, 0)
    if now is None or now.rows * step / pair.window < _FEWEST:
        return None
    best, delay = now, float("nan")
    number = now.rows * step / pair.window
    if pair.tells_delay:
        lags = np.arange(-round(_LATEST / step), round(_LATEST / step) + 1)
        shifted = [_correlation(pair, int(lag)) for lag in lags]
        sizes = np.array([0.0 if one is None else abs(one.correlation) for one in shifted])
        # What swings agrees with itself at many lags: the smaller ones are likelier.
        likely = np.array([_likelihood(size, number) for size in sizes]) - _PER_SECOND * step * np.abs(lags)
        at = int(likely.argmax())
        if 0 < at < lags.size - 1 and sizes[at] > _AGREED and likely[at] > likely[lags == 0] + _LIKELIER:
            before, here, after = sizes[at - 1 : at + 2]
            delay = float(step * (lags[at] + 0.5 * (before - after) / (before - 2.0 * here + after)))
            best = shifted[at] or now
    size = abs(best.correlation)
    weight = (
        0.0
        if size < (_LEAST if pair.most > _DOUBTFUL else _LEAST_DOUBTFUL)
        else min(pair.most, _likelihood(size, number))
    )
    return Agreement(
        pair.symbols, pair.words, best.correlation, best.gain, float(np.copysign(weight, best.correlation)), delay
    )


class _Correlation(NamedTuple):
    correlation: float
    gain: float
    rows: int


def _correlation(pair: _Pair, lag: int) -> _Correlation | None:
    """Correlate what is left of two signals beside others, the first taken so many cells later."""
    first = _later(pair.first, lag)
    rows = np.stack([first, pair.other, *pair.beside])
    rows = rows[:, np.isfinite(rows).all(axis=0)]
    number = rows.shape[1]
    rows = rows[:, :: 1 + number // _MOST_ROWS]
    if rows.shape[1] <= 2 + len(pair.beside):
        return None
    beside = np.stack([np.ones(rows.shape[1]), *rows[2:]], axis=1)
    size = np.maximum(np.abs(beside).max(axis=0), np.finfo(np.float64).tiny)
    basis, _ = np.linalg.qr(beside / size)
    left = rows[:2] - (rows[:2] @ basis) @ basis.T
    lengths = np.linalg.norm(left, axis=1)
    # What is constant, or nothing but what stands beside it, tells nothing.
    if not (lengths > 1e-9 * np.linalg.norm(rows[:2], axis=1)).all():
        return None
    correlation = float(left[0] @ left[1] / (lengths[0] * lengths[1]))
    return _Correlation(correlation, float(lengths[0] / lengths[1]), number)


def _likelihood(correlation: float, number: float) -> float:
    return float(-0.5 * number * np.log1p(-min(correlation**2, 0.99)))


def _later(values: Array, cells: int) -> Array:
    lost = np.full(abs(cells), np.nan)
    return np.concatenate([values[cells:], lost] if cells >= 0 else [lost, values[:cells]])


def _mean(values: Array, cells: int) -> Array:
    """Return means over so many cells, an even number, about each."""
    if values.size <= cells:
        return np.full(values.size, np.nan)
    inside = np.convolve(values, np.full(cells + 1, 1.0 / (cells + 1)), "valid")
    return np.pad(inside, cells // 2, constant_values=np.nan)


def _change(values: Array, cells: int) -> Array:
    """Return by how much values change over so many cells, an even number, about each."""
    if values.size <= cells:
        return np.full(values.size, np.nan)
    return np.pad(values[cells:] - values[:-cells], cells // 2, constant_values=np.nan)


def _even(window: float, step: float) -> int:
    """Return the even number of cells that is nearest to a time."""
    return 2 * max(1, round(0.5 * window / step))
