"""Standard deviations of estimates with autocorrelated residuals (HAC covariance; Andrews, Econometrica 59(3), 1991).

An estimate is a sum of influences times residuals; with white residuals its variance is the sum of squared influences.
Autocorrelated residuals add products of influences at different times. These are estimated in two ways, and the larger
counts: from white plus exponentially correlated noise fitted to the autocovariance of each channel's residuals (Morelli
and Klein, J. Aircraft 34(2), 1997), and from sums of scores over windows, which also see errors that last only for a
part of the time. Residuals are averaged over bins, so that time and memory stay small.

The estimated size of a fault is such a sum too. Its own effect is removed from the residuals first: otherwise a real
fault would look like autocorrelated noise, and the larger it were, the less significant.
"""

from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.arrays import Array
from auvid_cli.filters.problem import Indices, Timeline
from auvid_cli.numerics import compiled, types

_matrix = types.float64[:, ::1]
_stack = types.float64[:, :, ::1]
_indices = types.int64[::1]
_vector = types.float64[::1]
# Duration of a bin: residuals are averaged and scores are summed over it.
BIN = 0.1  # s
# First lag of the fitted autocovariance, beyond the internal filter of a sensor.
_FIRST_LAG = 3  # bins
_LAST_LAG = 600  # bins
# Length of the windows of all channels together.
_WINDOW = 100  # bins
# Smallest significant autocorrelation, in standard deviations of that of white noise.
_SIGNIFICANT = 5.0
# Smallest number of pairs of bins at a usable lag, relative to the most at any lag: a slow sensor leaves bins empty.
_MIN_PAIRS = 0.5
# Constant of Bartlett's window in Andrews's rule.
_BARTLETT = 1.1447
CACHE_SIZE = 2**27  # bytes; largest size of the rows kept for another iteration


class ResidualRows(NamedTuple):
    """Consecutive scalar measurements with their residuals, and a row of n numbers for each."""

    time: Array  # shape (m,); s, in order
    channel: Indices  # shape (m,); number of the component among those of all sensors
    residual: Array  # shape (m,); residual, normalised by its nominal standard deviation
    # Shape (m, n); change of n estimates per unit of the residual (influences), or of the residual per unit of n
    # parameters and faults (signatures)
    rows: Array

    @classmethod
    def of_present(cls, timeline: Timeline, present: NDArray[np.bool_], residual: Array, rows: Array) -> "ResidualRows":
        """Return the rows of the first measurements of a chunk, by `present` components, shape (m, c)."""
        n_measurements, n_components = present.shape
        time = np.repeat(timeline.time, np.diff(timeline.measurement_offset))[:n_measurements]
        channel = timeline.measurement_sensor[:n_measurements, None].astype(np.int64) * n_components
        return cls(
            np.repeat(time, n_components)[present.ravel()],
            (channel + np.arange(n_components))[present],
            residual[present],
            rows[present],
        )


RESIDUAL_ROWS = types.NamedTuple(
    (types.float64[::1], types.int64[::1], types.float64[::1], types.float64[:, ::1]), ResidualRows
)


class _CachedRows:
    """Rows of a segment, kept for further iterations if `n_chunks` chunks take at most `room` bytes."""

    def __init__(self, rows: Iterable[ResidualRows], room: int, n_chunks: int) -> None:
        self._rows, self._room, self._n_chunks = rows, room, n_chunks
        self._kept: list[ResidualRows] | None = None

    def __iter__(self) -> Iterator[ResidualRows]:
        if self._kept is not None:
            yield from self._kept
            return
        kept, room = list[ResidualRows](), self._room
        for number, chunk in enumerate(self._rows):
            size = sum(array.nbytes for array in chunk)
            room -= size
            if number == 0 and room < (self._n_chunks - 1) * size:
                room = -1
            if room >= 0:
                kept.append(chunk)
            else:
                # Further iterations do not try again.
                kept.clear()
                self._room = -1
            yield chunk
        if room >= 0:
            self._kept = kept


def cached(segments: Sequence[Iterable[ResidualRows]], n_chunks: Sequence[int]) -> list[Iterable[ResidualRows]]:
    """Keep the rows of all segments, of so many chunks, for further iterations if there is room."""
    room = CACHE_SIZE // len(segments)
    return [_CachedRows(segment, room, n) for segment, n in zip(segments, n_chunks, strict=True)]


@compiled(inline=True)
def bin_at(time, start):
    """Return the bin of a time since the start; samples at multiples of `BIN` are in the middle, safe from rounding."""
    return int((time - start) / BIN + 0.5)


class _Windows(NamedTuple):
    """Moving windows along a segment, one for each group of channels."""

    bin: Indices  # shape (1,); number of the current bin
    length: Indices  # shape (n_groups, n); number of bins in a window; 0 without windows
    score: Array  # shape (n_groups, n); sums of scores over the current bin
    window: Array  # shape (n_groups, n); sums of scores over the window
    scores: Array  # shape (longest, n_groups, n); sums over previous bins, as a ring buffer
    squares: Array  # shape (n_groups, n); sums of squared `window` over all positions


_WINDOWS = types.NamedTuple((_indices, types.int64[:, ::1], _matrix, _matrix, _stack, _matrix), _Windows)


@compiled()
def _close_window_bin(windows):
    """Move the windows by one bin."""
    n_bins, n_groups, n = windows.scores.shape
    now = windows.bin[0]
    place = now % n_bins
    for g in range(n_groups):
        score, window = windows.score[g], windows.window[g]
        for i in range(n):
            if windows.length[g, i] > 0:
                oldest = (now - windows.length[g, i]) % n_bins
                window[i] += score[i] - windows.scores[oldest, g, i]
                windows.scores[place, g, i], score[i] = score[i], 0.0
                windows.squares[g, i] += window[i] ** 2
    windows.bin[0] += 1


@compiled(types.void(RESIDUAL_ROWS, _vector, types.float64, _indices, _WINDOWS))
def _add_scores(influence, removed, start, group, windows):
    """Add scores to the windows of a segment with this start time."""
    for i in range(influence.time.size):
        while windows.bin[0] < bin_at(influence.time[i], start):
            _close_window_bin(windows)
        score, residual = windows.score[group[influence.channel[i]]], influence.residual[i]
        for k in range(score.size):
            row = influence.rows[i, k]
            score[k] += row * (residual - row * removed[k])


@compiled(types.void(_WINDOWS))
def _finish(windows):
    """Move the windows beyond the last bin of a segment."""
    for _ in range(windows.scores.shape[0]):
        _close_window_bin(windows)


class ScoreWindows:
    """Mean squares of the sums of scores over windows within segments.

    Parameters
    ----------
    group : ndarray of int, shape (n_channels,)
        Group of each channel; scores of a group are added before they are squared.
    length : ndarray of int, shape (n_groups, n)
        Number of bins in a window, for each parameter; 0 without windows.
    removed : ndarray, shape (n,), optional
        See `corrected_deviation`.
    """

    def __init__(self, group: Indices, length: Indices, removed: Array | None = None) -> None:
        self._group, self._length, self._squares = group, length, np.zeros(length.shape)
        self._removed = np.zeros(length.shape[1]) if removed is None else removed
        self._begin()

    def _begin(self) -> None:
        first, scores = np.zeros(1, dtype=np.int64), np.zeros((max(int(self._length.max()), 1), *self._squares.shape))
        score, window = np.zeros(self._squares.shape), np.zeros(self._squares.shape)
        self._start: float | None = None
        self._windows = _Windows(first, self._length, score, window, scores, self._squares)

    def add(self, influence: ResidualRows) -> None:
        """Add measurements of a segment."""
        if influence.time.size:
            self._start = float(influence.time[0]) if self._start is None else self._start
            _add_scores(influence, self._removed, self._start, self._group, self._windows)

    def end_segment(self) -> None:
        """Move the windows beyond the last measurement of a segment."""
        _finish(self._windows)
        self._begin()

    def mean_squares(self) -> Array:
        """Return the mean squares over all finished segments, shape (n_groups, n); zero without windows."""
        return self._squares / np.maximum(self._length, 1)


class _Sums(NamedTuple):
    """Sums over all segments."""

    number: Array  # shape (n_channels,); number of residuals
    # Shape (n_channels, n_kinds); sum of squared residuals: first as they are, then less the effect of each fault that
    # is removed
    squares: Array
    white: Array  # shape (n_channels, n); sum of squared influences
    products: Array  # shape (_LAST_LAG + 1, n_channels, n_kinds); sum of products of bin averages at each lag
    pairs: Array  # shape (_LAST_LAG + 1, n_channels); number of these products


class _Recent(NamedTuple):
    """Latest bins of a segment."""

    bin: Indices  # shape (1,); number of the current bin
    number: Array  # shape (n_channels,); number of residuals in the current bin
    total: Array  # shape (n_channels, n_kinds); their sum
    # Shape (_LAST_LAG + 1, n_channels, n_kinds); averages of previous bins, as a ring buffer; NaN without measurements
    averages: Array


_SUMS = types.NamedTuple((_vector, *[_matrix] * 2, _stack, _matrix), _Sums)
_RECENT = types.NamedTuple((_indices, _vector, _matrix, _stack), _Recent)


@compiled(types.void(_SUMS, _RECENT))
def _close_lag_bin(sums, recent):
    """Correlate the current bin with previous ones, and start the next."""
    n_lags, n_channels, n_kinds = recent.averages.shape
    place = recent.bin[0] % n_lags
    for c in range(n_channels):
        present = recent.number[c] > 0.0
        for kind in range(n_kinds):
            recent.averages[place, c, kind] = recent.total[c, kind] / recent.number[c] if present else np.nan
            recent.total[c, kind] = 0.0
        recent.number[c] = 0.0
        if present:
            for lag in range(n_lags):
                earlier = place - lag if lag <= place else place - lag + n_lags
                now, before = recent.averages[place, c], recent.averages[earlier, c]
                if not np.isnan(before[0]):
                    sums.pairs[lag, c] += 1.0
                    for kind in range(n_kinds):
                        sums.products[lag, c, kind] += now[kind] * before[kind]
    recent.bin[0] += 1


@compiled(types.void(RESIDUAL_ROWS, _vector, _indices, types.float64, _SUMS, _RECENT))
def _add_products(influence, removed, under_test, start, sums, recent):
    """Add measurements of a segment with this start time to the sums."""
    for i in range(influence.time.size):
        while recent.bin[0] < bin_at(influence.time[i], start):
            _close_lag_bin(sums, recent)
        c, residual = influence.channel[i], influence.residual[i]
        recent.number[c] += 1.0
        sums.number[c] += 1.0
        recent.total[c, 0] += residual
        sums.squares[c, 0] += residual**2
        for j in range(under_test.size):
            k = under_test[j]
            left = residual - influence.rows[i, k] * removed[k]
            recent.total[c, j + 1] += left
            sums.squares[c, j + 1] += left**2
        for k in range(sums.white.shape[1]):
            sums.white[c, k] += influence.rows[i, k] ** 2


@compiled(types.void(RESIDUAL_ROWS, _matrix, _vector, _matrix, _matrix))
def _add_pairs(influence, time_constant, latest, decayed, pairs):
    """Add products of influences of the same channel, weighted by ``exp(-lag / time_constant)``."""
    for i in range(influence.time.size):
        c = influence.channel[i]
        elapsed, former, factor = influence.time[i] - latest[c], 0.0, 0.0
        latest[c] = influence.time[i]
        for k in range(decayed.shape[1]):
            if time_constant[c, k] > 0.0:
                if time_constant[c, k] != former:
                    former = time_constant[c, k]
                    factor = np.exp(-elapsed / former)
                row = influence.rows[i, k]
                decayed[c, k] *= factor
                pairs[c, k] += row * decayed[c, k]
                decayed[c, k] += row


class _Autocovariance(NamedTuple):
    """White plus exponentially correlated noise of each channel, for each kind of residuals."""

    variance: Array  # shape (n_channels, n_kinds); variance of the sum
    correlated: Array  # shape (n_channels, n_kinds); variance of the correlated part
    time_constant: Array  # shape (n_channels, n_kinds); s; 0 for a white channel


def corrected_deviation(
    nominal: Array, segments: Sequence[Iterable[ResidualRows]], n_channels: int, removed: Array | None = None
) -> Array:
    """Return standard deviations that allow for autocorrelated residuals.

    Parameters
    ----------
    nominal : ndarray, shape (n,)
        Standard deviations of the parameters with white residuals. The contribution of a prior is not corrected.
    segments : sequence of iterable of ResidualRows
        Influences; each is read once, and a second time if residuals are autocorrelated.
    n_channels : int
    removed : ndarray, shape (n,), optional
        Scores of faults; influence times score is subtracted from the residuals. 0 for a parameter, because the
        residuals already belong to its estimate.

    Returns
    -------
    ndarray, shape (n,)
        At least `nominal`.
    """
    removed = np.zeros(nominal.size) if removed is None else removed
    under_test = np.flatnonzero(removed)
    kind = np.zeros(nominal.size, dtype=np.int64)
    kind[under_test] = 1 + np.arange(under_test.size)
    sums, joint, duration = _first_pass(removed, under_test, segments, n_channels)
    variance, correlated, time_constant = (values[:, kind].copy() for values in _fit_autocovariance(sums))
    variance *= sums.white
    if correlated.any():
        pairs, windowed = _second_pass(removed, segments, time_constant, duration)
        variance = np.maximum(variance + 2.0 * correlated * pairs, windowed)
    largest = np.maximum(variance.sum(axis=0), joint)
    return np.sqrt(nominal**2 + np.maximum(largest - sums.white.sum(axis=0), 0.0))


def _first_pass(
    removed: Array, under_test: Indices, segments: Sequence[Iterable[ResidualRows]], n_channels: int
) -> tuple[_Sums, Array, float]:
    """Return sums, mean squares of the scores of all channels together, shape (n,), and the duration of all data, s."""
    n, n_kinds = removed.size, 1 + under_test.size
    sums = _Sums(
        np.zeros(n_channels),
        np.zeros((n_channels, n_kinds)),
        np.zeros((n_channels, n)),
        np.zeros((_LAST_LAG + 1, n_channels, n_kinds)),
        np.zeros((_LAST_LAG + 1, n_channels)),
    )
    windows, duration = ScoreWindows(np.zeros(n_channels, dtype=np.int64), np.full((1, n), _WINDOW), removed), 0.0
    for segment in segments:
        recent = _Recent(
            bin=np.zeros(1, dtype=np.int64),
            number=np.zeros(n_channels),
            total=np.zeros((n_channels, n_kinds)),
            averages=np.full((_LAST_LAG + 1, n_channels, n_kinds), np.nan),
        )
        start, end = None, 0.0
        for influence in segment:
            windows.add(influence)
            if influence.time.size:
                start = float(influence.time[0]) if start is None else start
                end = float(influence.time[-1])
                _add_products(influence, removed, under_test, start, sums, recent)
        _close_lag_bin(sums, recent)
        windows.end_segment()
        duration += 0.0 if start is None else end - start
    return sums, windows.mean_squares()[0], duration


def _second_pass(
    removed: Array, segments: Sequence[Iterable[ResidualRows]], time_constant: Array, duration: float
) -> tuple[Array, Array]:
    """Return products of influences, and mean squares of scores over windows, by channel, shape (n_channels, n)."""
    n_channels = len(time_constant)
    pairs = np.zeros(time_constant.shape)
    windows = ScoreWindows(np.arange(n_channels), _window_length(time_constant, duration), removed)
    for segment in segments:
        latest, decayed = np.full(n_channels, -np.inf), np.zeros(pairs.shape)
        for influence in segment:
            _add_pairs(influence, time_constant, latest, decayed, pairs)
            windows.add(influence)
        windows.end_segment()
    return pairs, windows.mean_squares()


def _window_length(time_constant: Array, duration: float) -> Indices:
    """Return the window length of least mean square error (Andrews's rule), in bins; 0 for a white channel."""
    best = _BARTLETT * np.cbrt(time_constant**2 * duration)
    return np.where(time_constant > 0.0, np.maximum(np.rint(best / BIN), 1.0), 0.0).astype(np.int64)


def _fit_autocovariance(sums: _Sums) -> _Autocovariance:
    variance = sums.squares / np.maximum(sums.number, 1.0)[:, None]
    correlated, time_constant = np.zeros(variance.shape), np.zeros(variance.shape)
    for c, pairs in enumerate(sums.pairs.T):
        enough = pairs >= _MIN_PAIRS * pairs[1:].max()
        enough[:_FIRST_LAG] = False
        lags = np.flatnonzero(enough & (pairs > 0.0))
        if not lags.size:
            continue
        for kind, products in enumerate(sums.products[:, c].T):
            covariance = products[lags] / pairs[lags]
            # Compared with the chance covariance of white averages.
            if covariance[0] > _SIGNIFICANT * products[0] / pairs[0] / np.sqrt(pairs[lags[0]]):
                below = np.flatnonzero(covariance < covariance[0] / np.e)
                end = lags[below[0]] if below.size else lags[-1] + 1
                time = BIN * (end - lags[0])
                time_constant[c, kind] = time
                correlated[c, kind] = min(covariance[0] * np.exp(BIN * lags[0] / time), variance[c, kind])
    return _Autocovariance(variance, correlated, time_constant)
