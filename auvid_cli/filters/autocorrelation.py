"""Standard deviations of estimates with autocorrelated residuals (HAC covariance; Andrews, Econometrica 59(3),
1991).
"""

from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numba import types
from numpy.typing import NDArray

from auvid_cli.filters.problem import Indices
from auvid_cli.numerics import compiled

Array = NDArray[np.float64]
_matrix = types.float64[:, ::1]
_stack = types.float64[:, :, ::1]
_indices = types.int64[::1]
BIN = 0.1
"""s, over which residuals are averaged, and scores summed, before they are correlated."""
_vector = types.float64[::1]
# Bins: where the autocovariance is read first, beyond what a sensor's own filter does, and last; windows of the scores
# of all channels together.
_FIRST_LAG, _LAST_LAG, _WINDOW = 3, 600, 100
# Standard deviations of chance above which an autocorrelation is believed.
_SIGNIFICANT = 5.0
# Of the pairs of bins that a lag has at most, how many it must have to be looked at: a slow sensor leaves bins empty.
_SHARE_OF_PAIRS = 0.5
# Of Bartlett's window, in Andrews's rule.
_BARTLETT = 1.1447
# Bytes of influences that are kept for the second time.
_ROOM = 2**27


class Influence(NamedTuple):
    """Influence of consecutive scalar measurements on a batch estimate.

    Attributes
    ----------
    time : ndarray, shape (m,)
        s, in order.
    channel : ndarray of int, shape (m,)
        Which component of which sensor it is.
    residual : ndarray, shape (m,)
        By the standard deviation that it should have.
    rows : ndarray, shape (m, n)
        By how much each parameter moves for each unit of it.
    """

    time: Array
    channel: Indices
    residual: Array
    rows: Array


INFLUENCE = types.NamedTuple(
    (types.float64[::1], types.int64[::1], types.float64[::1], types.float64[:, ::1]), Influence
)


@compiled(inline=True)
def bin_at(time, start):
    """Return in which bin of a segment a time lies; what comes regularly is in its middle, safe from rounding."""
    return int((time - start) / BIN + 0.5)


class _Windows(NamedTuple):
    """Windows that move along a segment, one for each group of channels.

    Attributes
    ----------
    bin : ndarray of int, shape (1,)
        Which is being filled.
    length : ndarray of int, shape (n_groups,)
        Bins; 0 for a group that is not looked at.
    score, window : ndarray, shape (n_groups, n)
        Sums over the bin, and over the window.
    scores : ndarray, shape (longest, n_groups, n)
        Of the bins before, in a ring.
    squares : ndarray, shape (n_groups, n)
        Of the sums over all windows.
    """

    bin: Indices
    length: Indices
    score: Array
    window: Array
    scores: Array
    squares: Array


_WINDOWS = types.NamedTuple((_indices, _indices, _matrix, _matrix, _stack, _matrix), _Windows)


@compiled()
def _close_window_bin(windows):
    """Move the windows on by the bin that is full."""
    n_bins, n_groups, n = windows.scores.shape
    now = windows.bin[0]
    place = now % n_bins
    for g in range(n_groups):
        if windows.length[g] > 0:
            score, window, oldest = windows.score[g], windows.window[g], (now - windows.length[g]) % n_bins
            for i in range(n):
                window[i] += score[i] - windows.scores[oldest, g, i]
                windows.scores[place, g, i], score[i] = score[i], 0.0
                windows.squares[g, i] += window[i] ** 2
    windows.bin[0] += 1


@compiled(types.void(INFLUENCE, types.float64, _indices, _WINDOWS))
def _add_scores(influence, start, group, windows):
    """Add the scores of a segment that starts at some time."""
    for i in range(influence.time.size):
        while windows.bin[0] < bin_at(influence.time[i], start):
            _close_window_bin(windows)
        score, residual = windows.score[group[influence.channel[i]]], influence.residual[i]
        for k in range(score.size):
            score[k] += influence.rows[i, k] * residual


@compiled(types.void(_WINDOWS))
def _finish(windows):
    """Move the windows on until they are behind the last bin of a segment."""
    for _ in range(windows.scores.shape[0]):
        _close_window_bin(windows)


class ScoreWindows:
    """Mean squares of the sums of scores over windows, none of which reaches from segment to segment.

    Parameters
    ----------
    n : int
        How many parameters there are.
    group : ndarray of int, shape (n_channels,)
        Which channels' scores are added before they are squared.
    length : ndarray of int, shape (n_groups,)
        Of a group's windows, bins; 0 for one that is not looked at.
    """

    def __init__(self, n: int, group: Indices, length: Indices) -> None:
        self._group, self._length, self._squares = group, length, np.zeros((length.size, n))
        self._begin()

    def _begin(self) -> None:
        here, scores = np.zeros(1, dtype=np.int64), np.zeros((max(int(self._length.max()), 1), *self._squares.shape))
        score, window = np.zeros(self._squares.shape), np.zeros(self._squares.shape)
        self._start: float | None = None
        self._windows = _Windows(here, self._length, score, window, scores, self._squares)

    def add(self, influence: Influence) -> None:
        """Take in measurements of a segment."""
        if influence.time.size:
            self._start = float(influence.time[0]) if self._start is None else self._start
            _add_scores(influence, self._start, self._group, self._windows)

    def end_segment(self) -> None:
        """Move on until the last measurement of a segment has left the windows."""
        _finish(self._windows)
        self._begin()

    def mean_squares(self) -> Array:
        """Return those of all segments that ended, shape (n_groups, n); zero for a group that is not looked at."""
        return self._squares / np.maximum(self._length, 1)[:, None]


class _Sums(NamedTuple):
    """What is added up over all segments.

    Attributes
    ----------
    squares, taken : ndarray, shape (n_channels,)
        Of the residuals, and their number.
    white : ndarray, shape (n_channels, n)
        Squares of the influences.
    products, pairs : ndarray, shape (_LAST_LAG + 1, n_channels)
        Of averages over bins that are so many bins apart.
    """

    squares: Array
    taken: Array
    white: Array
    products: Array
    pairs: Array


class _Recent(NamedTuple):
    """The bins of a segment that later ones are correlated with, one after the other in a ring.

    Attributes
    ----------
    bin : ndarray of int, shape (1,)
        Which is being filled.
    total, taken : ndarray, shape (n_channels,)
        Sum of its residuals, and their number.
    averages : ndarray, shape (_LAST_LAG + 1, n_channels)
        NaN where there was no measurement.
    """

    bin: Indices
    total: Array
    taken: Array
    averages: Array


_SUMS = types.NamedTuple((_vector, _vector, _matrix, _matrix, _matrix), _Sums)


_RECENT = types.NamedTuple((_indices, _vector, _vector, _matrix), _Recent)


@compiled(types.void(_SUMS, _RECENT))
def _close_lag_bin(sums, recent):
    """Correlate the bin that is full with those before, and begin the next."""
    n_lags, n_channels = recent.averages.shape
    place = recent.bin[0] % n_lags
    for c in range(n_channels):
        average = np.nan
        if recent.taken[c] > 0.0:
            average = recent.total[c] / recent.taken[c]
        recent.averages[place, c] = average
        recent.total[c], recent.taken[c] = 0.0, 0.0
        if not np.isnan(average):
            for lag in range(n_lags):
                product = average * recent.averages[place - lag if lag <= place else place - lag + n_lags, c]
                if not np.isnan(product):
                    sums.products[lag, c] += product
                    sums.pairs[lag, c] += 1.0
    recent.bin[0] += 1


@compiled(types.void(INFLUENCE, types.float64, _SUMS, _RECENT))
def _add_products(influence, start, sums, recent):
    """Add measurements of a segment that starts at some time to the sums."""
    for i in range(influence.time.size):
        while recent.bin[0] < bin_at(influence.time[i], start):
            _close_lag_bin(sums, recent)
        c, residual = influence.channel[i], influence.residual[i]
        recent.total[c] += residual
        recent.taken[c] += 1.0
        sums.squares[c] += residual**2
        sums.taken[c] += 1.0
        for k in range(sums.white.shape[1]):
            sums.white[c, k] += influence.rows[i, k] ** 2


@compiled(types.void(INFLUENCE, _vector, _vector, _matrix, _matrix))
def _pair(influence, time_constant, latest, faded, pairs):
    """Add to the products of influences on a channel, by how much of the earlier one is left at the later."""
    for i in range(influence.time.size):
        c = influence.channel[i]
        if time_constant[c] > 0.0:
            left = np.exp((latest[c] - influence.time[i]) / time_constant[c])
            latest[c] = influence.time[i]
            for k in range(faded.shape[1]):
                row = influence.rows[i, k]
                faded[c, k] *= left
                pairs[c, k] += row * faded[c, k]
                faded[c, k] += row


class _Autocovariance(NamedTuple):
    """White noise, and noise that fades exponentially: of each channel, shape (n_channels,).

    Attributes
    ----------
    variance : ndarray
        Of both.
    coloured : ndarray
        Of what fades.
    time_constant : ndarray
        s; 0 where nothing is coloured.
    """

    variance: Array
    coloured: Array
    time_constant: Array


def corrected_deviation(nominal: Array, segments: Sequence[Iterable[Influence]], n_channels: int) -> Array:
    """Find standard deviations that allow for the autocorrelation of residuals.

    Time is linear in the measurements, and memory does not grow with them.

    Parameters
    ----------
    nominal : ndarray, shape (n,)
        Of the parameters, as white residuals would leave them. What a prior contributes to these stays as it is.
    segments : sequence of iterable of Influence
        Each is gone through once, and, unless there was room to keep it, once more if any residuals are coloured.
    n_channels : int

    Returns
    -------
    ndarray, shape (n,)
        No less than the nominal ones.
    """
    segments = [_InfluenceCache(segment, _ROOM // len(segments)) for segment in segments]
    sums, together, duration = _sums(nominal.size, segments, n_channels)
    noise = _fitted(sums)
    fitted = noise.variance[:, None] * sums.white
    if noise.coloured.any():
        pairs, alone = _second_pass(nominal.size, segments, noise.time_constant, duration)
        fitted = np.maximum(fitted + 2.0 * noise.coloured[:, None] * pairs, alone)
    most = np.maximum(fitted.sum(axis=0), together)
    return np.sqrt(nominal**2 + np.maximum(most - sums.white.sum(axis=0), 0.0))


class _InfluenceCache:
    """Influences of a segment that are kept for those who ask again, if they take no more than so many bytes."""

    def __init__(self, influences: Iterable[Influence], room: int) -> None:
        self._influences, self._room = influences, room

    def __iter__(self) -> Iterator[Influence]:
        kept, room = list[Influence](), self._room
        for influence in self._influences:
            room -= sum(array.nbytes for array in influence)
            kept = [*kept, influence] if room >= 0 else []
            yield influence
        if room >= 0:
            self._influences = kept


def _sums(n: int, segments: Sequence[Iterable[Influence]], n_channels: int) -> tuple[_Sums, Array, float]:
    """Go through all data: sums, mean squares of scores of all channels together, shape (n,), and how long it is, s."""
    of_channels, of_lags = np.zeros(n_channels), np.zeros((_LAST_LAG + 1, n_channels))
    white, duration = np.zeros((n_channels, n)), 0.0
    sums = _Sums(of_channels, of_channels.copy(), white, of_lags, of_lags.copy())
    together = ScoreWindows(n, np.zeros(n_channels, dtype=np.int64), np.array([_WINDOW]))
    for segment in segments:
        recent, start, end = _nothing_yet(n_channels), None, 0.0
        for influence in segment:
            together.add(influence)
            if influence.time.size:
                start = float(influence.time[0]) if start is None else start
                end = float(influence.time[-1])
                _add_products(influence, start, sums, recent)
        _close_lag_bin(sums, recent)
        together.end_segment()
        duration += 0.0 if start is None else end - start
    return sums, together.mean_squares()[0], duration


def _nothing_yet(n_channels: int) -> _Recent:
    return _Recent(
        bin=np.zeros(1, dtype=np.int64),
        total=np.zeros(n_channels),
        taken=np.zeros(n_channels),
        averages=np.full((_LAST_LAG + 1, n_channels), np.nan),
    )


def _second_pass(
    n: int, segments: Sequence[Iterable[Influence]], time_constant: Array, duration: float
) -> tuple[Array, Array]:
    """Return products of influences on each channel, and mean squares of its scores, shape (n_channels, n)."""
    n_channels = time_constant.size
    pairs = np.zeros((n_channels, n))
    alone = ScoreWindows(n, np.arange(n_channels), _window(time_constant, duration))
    for segment in segments:
        latest, faded = np.full(n_channels, -np.inf), np.zeros(pairs.shape)
        for influence in segment:
            _pair(influence, time_constant, latest, faded, pairs)
            alone.add(influence)
        alone.end_segment()
    return pairs, alone.mean_squares()


def _window(time_constant: Array, duration: float) -> Indices:
    """Return how long windows are for noise that fades, bins: of least mean square error (Andrews); 0 for none."""
    best = _BARTLETT * np.cbrt(time_constant**2 * duration)
    return np.where(time_constant > 0.0, np.maximum(np.rint(best / BIN), 1.0), 0.0).astype(np.int64)


def _fitted(sums: _Sums) -> _Autocovariance:
    variance = sums.squares / np.maximum(sums.taken, 1.0)
    coloured, time_constant = np.zeros(variance.size), np.zeros(variance.size)
    for c, (products, pairs) in enumerate(zip(sums.products.T, sums.pairs.T, strict=True)):
        enough = pairs >= _SHARE_OF_PAIRS * pairs[1:].max()
        enough[:_FIRST_LAG] = False
        lags = np.flatnonzero(enough & (pairs > 0.0))
        if not lags.size:
            continue
        covariance = products[lags] / pairs[lags]
        # What chance leaves of the covariance of white averages.
        if covariance[0] > _SIGNIFICANT * products[0] / pairs[0] / np.sqrt(pairs[lags[0]]):
            below = np.flatnonzero(covariance < covariance[0] / np.e)
            end = lags[below[0]] if below.size else lags[-1] + 1
            time_constant[c] = BIN * (end - lags[0])
            coloured[c] = min(covariance[0] * np.exp(BIN * lags[0] / time_constant[c]), variance[c])
    return _Autocovariance(variance, coloured, time_constant)
