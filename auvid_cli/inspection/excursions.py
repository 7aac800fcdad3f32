"""Headings that swing away for seconds from what the turn rate, or another heading, says."""

from collections.abc import Collection

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from auvid_cli.data.check import Check
from auvid_cli.inspection.grid import Signals, derivative, smoothed
from auvid_cli.inspection.inspection import Mark, cannot_tell, judged
from auvid_cli.inspection.regression import fit
from auvid_cli.inspection.single_sensor import noise_floor
from auvid_cli.vehicle.kinematics import euler_rates

Array = NDArray[np.float64]

_LEAST = np.deg2rad(3.0)
_TIMES_NOISE = 8.0
# s, over which the difference of two headings may drift, and so be taken off.
_DRIFT = 12.0
_THRESHOLD = (
    f"<= {np.rad2deg(_LEAST):.2g} deg or {_TIMES_NOISE:g} times their noise, apart from drift over {_DRIFT:g} s"
)
_SENSORS = {"psi": "attitude", "heading": "magnetometer"}


def excursion_checks(signals: Signals, stepped: Collection[str]) -> tuple[list[Check], list[Mark]]:
    """Judge each heading by the integrated turn rate, or without one psi by the other heading.

    Parameters
    ----------
    signals : Signals
    stepped : collection of str
        Headings of which steps were found; they are not judged again.

    Returns
    -------
    checks : list of Check
        None of a heading that turns otherwise than its reference altogether, which is named elsewhere.
    marks : list of Mark
        When they were away.
    """
    headings = [symbol for symbol in _SENSORS if signals.has(symbol) and symbol not in stepped]
    turned = _turned(signals)
    if turned is not None:
        pairs = [(symbol, "integrated r", turned) for symbol in headings]
    else:
        pairs = [("psi", "heading", signals.values["heading"])] if len(headings) == len(_SENSORS) else []
    checks, marks = [] if pairs else [_cannot_tell(symbol) for symbol in headings], []
    for symbol, name, reference in pairs:
        heading = signals.values[symbol]
        if _turn_alike(signals, heading, reference):
            spans, peaks = _away(signals, heading - reference)
            checks.append(_check(symbol, name, spans, peaks))
            marks += [Mark(_SENSORS[symbol], "step", *span) for span in spans.tolist()]
    return checks, marks


def _turned(signals: Signals) -> Array | None:
    """Integrate the heading by the gyroscope; NaN where it was silent, and then from another beginning."""
    if not signals.has("q", "r"):
        return None
    value = signals.values
    nothing = np.zeros(signals.grid.cells)
    rates = np.column_stack((nothing, value["q"], value["r"]))
    tilt = value.get("phi", nothing), value.get("theta", nothing)
    rate = euler_rates(rates, np.column_stack((*tilt, nothing)))[:, 2]
    finite = np.isfinite(rate)
    known = np.where(finite, rate, 0.0)
    # To the middle of each cell, where its heading is: in a fast turn half a cell is degrees.
    return np.where(finite, (np.cumsum(known) - 0.5 * known) * signals.grid.step, np.nan)


def _turn_alike(signals: Signals, heading: Array, reference: Array) -> bool:
    window = signals.window("psi", "heading", "r")
    rate, expected = (smoothed(derivative(each, signals.grid.step), window) for each in (heading, reference))
    fitted = fit(rate, expected, [], window)
    return fitted is not None and 0.5 < fitted.gain < 2.0


def _away(signals: Signals, difference: Array) -> tuple[Array, Array]:
    """Find first and last time, s, of each excursion, and how far it went, rad."""
    at = np.flatnonzero(np.isfinite(difference))
    # Round north, and about what two headings differ by for long: declination, drift.
    difference = np.unwrap(difference[at])
    swing = difference - median_filter(difference, round(_DRIFT / signals.grid.step), mode="nearest")
    # Not its own scatter, which excursions that are many would raise.
    beyond = np.abs(swing) > max(_LEAST, _TIMES_NOISE * noise_floor(difference))
    edges = np.flatnonzero(np.diff(np.concatenate([[False], beyond, [False]]).astype(np.int8)))
    begin, end = edges[::2], edges[1::2]
    peaks = np.array([swing[a:b][np.abs(swing[a:b]).argmax()] for a, b in zip(begin, end, strict=True)])
    centres = signals.grid.centres()[at]
    return np.stack([centres[begin], centres[end - 1]], axis=1), peaks


def _cannot_tell(symbol: str) -> Check:
    reason = "neither a gyroscope nor another heading"
    return cannot_tell(_SENSORS[symbol], f"excursions of {symbol}", reason, _THRESHOLD)


def _check(symbol: str, reference: str, spans: Array, peaks: Array) -> Check:
    statistic = "none"
    if peaks.size:
        times = ", ".join(f"{start:.4g} to {end:.4g}" for start, end in spans[:3])
        largest = peaks[np.abs(peaks).argmax()]
        statistic = (
            f"{peaks.size}, largest {np.rad2deg(largest):.3g} deg: t = {times}{' ...' if peaks.size > 3 else ''} s"
        )
    return judged(
        _SENSORS[symbol],
        f"excursions of {symbol} from {reference}",
        statistic=statistic,
        threshold=_THRESHOLD,
        passed=not peaks.size,
        advice=f"{symbol} goes away and comes back though the vehicle does not turn so: iron, a motor or a modem "
        "disturbs the compass. Mark those times as not valid, or use the other source.",
    )
