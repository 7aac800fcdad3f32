"""Influence of measurements on a batch estimate, and sums of its scores over windows of time (HAC covariance).

Of an estimate that errs by ``sum(s_i)`` the mean square of the sums over all windows of length L is
``sum_ij max(0, 1 - |t_i - t_j| / L) s_i s_j``, Bartlett's window of their products (Newey and West, Econometrica 55(3),
1987).
"""

from typing import NamedTuple

import numpy as np
from numba import types
from numpy.typing import NDArray

from auvid_cli.compilation import compiled
from auvid_cli.filters.problem import Indices

Array = NDArray[np.float64]

_matrix = types.float64[:, ::1]
_stack = types.float64[:, :, ::1]
_indices = types.int64[::1]


BIN = 0.1
"""s, over which residuals are averaged, and scores summed, before they are correlated."""


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


@compiled(types.int64(types.float64, types.float64), inline=True)
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


@compiled(types.void(_WINDOWS), internal=True)
def _close_bin(windows):
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
def _gather(influence, start, group, windows):
    """Add the scores of a segment that starts at some time."""
    for i in range(influence.time.size):
        while windows.bin[0] < bin_at(influence.time[i], start):
            _close_bin(windows)
        score, residual = windows.score[group[influence.channel[i]]], influence.residual[i]
        for k in range(score.size):
            score[k] += influence.rows[i, k] * residual


@compiled(types.void(_WINDOWS))
def _finish(windows):
    """Move the windows on until they are behind the last bin of a segment."""
    for _ in range(windows.scores.shape[0]):
        _close_bin(windows)


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
            _gather(influence, self._start, self._group, self._windows)

    def end_segment(self) -> None:
        """Move on until the last measurement of a segment has left the windows."""
        _finish(self._windows)
        self._begin()

    def mean_squares(self) -> Array:
        """Return those of all segments that ended, shape (n_groups, n); zero for a group that is not looked at."""
        return self._squares / np.maximum(self._length, 1)[:, None]
