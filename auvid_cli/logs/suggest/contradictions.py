"""Signals that should be related by kinematics but are not, so that the name of one of them is wrong."""

from collections.abc import Iterator, Mapping

import numpy as np

from auvid_cli.arrays import Array
from auvid_cli.data.signals import estimate_noise
from auvid_cli.logs.suggest.filtered import unwrapped
from auvid_cli.logs.suggest.numbered_fins import correlation
from auvid_cli.logs.suggest.relations import Signals, Track, on_grid

RATES = {"phi": "p", "theta": "q", "psi": "r"}
_WINDOW = 1.0  # s, over which changes are taken
_AGREES = 0.8  # smallest correlation of signals that agree
_DISAGREES = {"rate": 0.6, "depth": 0.3}  # largest correlation of a contradiction; heave changes the depth too
_CLEAR = 4.0  # smallest spread of a change, divided by that of its noise
_STEADY = 0.3  # smallest correlation of a signal with itself after `_WINDOW`
_MIN_SECONDS = 60.0  # s, of a log that can contradict a name
_MAX_LAG = 30.0  # s; signals that agree at such a lag have wrong times, not wrong names
ANGLE_UNITS = (1.0, float(np.radians(1.0)))  # angles may be in rad or degrees


def contradictions(tracks: Mapping[str, Track]) -> dict[str, tuple[str, float]]:
    """Return the symbols that move clearly, contradict another signal and agree with none.

    Parameters
    ----------
    tracks : mapping of str to Track
        Signals by symbol; angles may be in rad or degrees.

    Returns
    -------
    dict
        The other symbol and the largest correlation with it at any lag, by symbol. Both signals of a pair may be in
        it: nothing shows then which of both has the wrong name.
    """
    smooth = {symbol: Track(track.time, unwrapped(track.values)) for symbol, track in tracks.items()}
    # Unwrapped angles keep their names from the interpolation of wrapped ones.
    signals = on_grid({_plain(symbol): track for symbol, track in smooth.items()})
    if signals is None or signals.step * next(iter(signals.values.values())).size < _MIN_SECONDS:
        return {}
    found: dict[str, tuple[str, float]] = {}
    supported = set[str]()
    for first, other, pairs in _pairs(signals):
        size = max(_largest_correlation(signals.step, *pair) for pair in pairs)
        if size > _AGREES:
            supported |= {first, other}
        elif size < _DISAGREES["depth" if first == "down" else "rate"] and _is_clear(signals, smooth, first, *pairs[0]):
            found |= {first: (other, size), other: (first, size)}
    return {symbol: why for symbol, why in found.items() if symbol not in supported}


def _plain(symbol: str) -> str:
    return f"unwrapped.{symbol}"


def _change(signals: Signals, symbol: str) -> Array:
    return signals.change(signals.values[_plain(symbol)], _WINDOW)


def _pairs(signals: Signals) -> Iterator[tuple[str, str, list[tuple[Array, Array]]]]:
    """Yield two symbols, and the signals that should agree for one of the units of angles."""
    rates = [rate for rate in RATES.values() if signals.has(_plain(rate))]
    angles = [angle for angle in RATES if signals.has(_plain(angle))]
    changes = {angle: _change(signals, angle) for angle in angles}
    means = {rate: signals.mean(_plain(rate)) for rate in rates}
    crossed = [
        (angle, rate)
        for angle in angles
        for rate in rates
        if RATES[angle] != rate and _largest_correlation(signals.step, changes[angle], means[rate]) > _AGREES
    ]
    # Two angles that follow each other's rate are those of exchanged axes, which other relations find.
    exchanged = {
        symbol
        for angle, rate in crossed
        for symbol in (angle, rate)
        if any((other, RATES[angle]) in crossed for other in angles if RATES[other] == rate)
    }
    for angle in angles:
        rate = RATES[angle]
        if rate in rates and not {angle, rate} & exchanged:
            yield angle, rate, [(changes[angle], means[rate])]
    if signals.has(_plain("down"), _plain("u")) and "theta" in angles and "theta" not in exchanged:
        sinking, u, theta = _change(signals, "down"), signals.mean(_plain("u")), signals.mean(_plain("theta"))
        climbs = [speed * np.sin(factor * theta) for factor in ANGLE_UNITS for speed in (u, 1.0)]
        # Axes of a DVL to starboard: its second component is the speed; axes of an attitude: its roll is the pitch.
        if "phi" in angles:
            climbs += [np.sin(factor * signals.mean(_plain("phi"))) for factor in ANGLE_UNITS]
        yield "down", "theta", [(sinking, climb) for climb in climbs]


def _is_clear(signals: Signals, tracks: Mapping[str, Track], symbol: str, change: Array, other: Array) -> bool:
    """Whether a signal and its counterpart change clearly more than their noise."""
    noise = estimate_noise(tracks[symbol].values).standard_deviation
    spread = float(np.nanstd(change))
    # The counterpart must not be mere noise either: neighbours on the grid agree then.
    known = other[np.isfinite(other)]
    lag = max(1, round(_WINDOW / signals.step))
    is_steady = known.size > 2 * lag and correlation(known[:-lag], known[lag:]) > _STEADY
    return spread > (_CLEAR * np.sqrt(2.0) * noise if np.isfinite(noise) else 0.0) and is_steady


def _largest_correlation(step: float, first: Array, other: Array) -> float:
    """Return the largest absolute correlation at any lag; 1 if one signal is constant or unknown."""
    both = np.isfinite(first) & np.isfinite(other)
    if np.count_nonzero(both) * step < _MIN_SECONDS:
        return 1.0
    a, b = (np.where(both, values - np.mean(values[both]), 0.0) for values in (first, other))
    size = float(np.linalg.norm(a) * np.linalg.norm(b))
    if not size > 0.0:
        return 1.0
    n = 2 * a.size
    of_lags = np.fft.irfft(np.fft.rfft(a, n) * np.conj(np.fft.rfft(b, n)), n) / size
    near = round(1.0 / step)
    far = min(a.size // 4, round(_MAX_LAG / step))
    sizes = np.abs(np.concatenate([of_lags[: far + 1], of_lags[n - far :]]))
    close = np.abs(np.concatenate([of_lags[: near + 1], of_lags[n - near :]]))
    return float(sizes.max()) if sizes.max() > _AGREES else float(close.max())
