"""Errors of sensors that last: offsets, scales and excursions."""

from collections.abc import Collection, Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from auvid_cli.data.checks import Check
from auvid_cli.data.dataset import Dataset, SensorRecord
from auvid_cli.inspection.inspection import Mark, cannot_tell, judged
from auvid_cli.inspection.kinematic_relations import Signals, change, derivative, fit, smoothed
from auvid_cli.inspection.single_sensor import noise_floor
from auvid_cli.vehicle.kinematics import euler_rates
from auvid_cli.vehicle.parameters import INERTIAL, SENSORS

Array = NDArray[np.float64]
_LEAST = np.deg2rad(3.0)
_TIMES_NOISE = 8.0
# s, over which the difference of two headings may drift, and so be taken off.
_DRIFT = 12.0
_THRESHOLD = (
    f"<= {np.rad2deg(_LEAST):.2g} deg or {_TIMES_NOISE:g} times their noise, apart from drift over {_DRIFT:g} s"
)
_SENSORS = {"psi": "attitude", "heading": "magnetometer"}
# s, over which rates are averaged: what lasts for less is noise to whoever identifies.
_SPAN = 5.0
_FEWEST = 6
# Times what the stated noise leaves of that average.
_LARGEST = 2.0
_PITCHED = np.deg2rad(80.0)


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


class LastingError(NamedTuple):
    """Of a rate of the gyroscope: what the attitude does not explain, averaged over some seconds.

    Attributes
    ----------
    rate : str
    size, expected : float
        Root mean square, and what noise as stated makes of it, rad/s.
    gain : float
        In log-likelihood, if noise were as large as it is; 0 where it is no larger than stated.
    """

    rate: str
    size: float
    expected: float
    gain: float

    @property
    def is_beyond_noise(self) -> bool:
        """Say whether it is there."""
        return self.size > _LARGEST * self.expected


def lasting_errors(signals: Signals, sensors: Mapping[str, SensorRecord]) -> list[LastingError]:
    """Find them for each rate, where all rates and angles are measured.

    The change of each angle by the rates is Fossen (2011), eq. (2.26). What is in proportion to that change, or to how
    it changes, is a scale or a delay, and is left out.
    """
    if not signals.has("p", "q", "r", "phi", "theta", "psi"):
        return []
    p, q, r, phi, theta, psi = (signals.values[symbol] for symbol in ("p", "q", "r", "phi", "theta", "psi"))
    turning = q * np.sin(phi) + r * np.cos(phi)
    level = np.where(np.abs(theta) < _PITCHED, np.cos(theta), np.nan)
    turned = {
        "p": (p + np.sin(theta) / level * turning, phi),
        "q": (q * np.cos(phi) - r * np.sin(phi), theta),
        "r": (turning / level, psi),
    }
    return [
        found
        for rate, (by_rates, angle) in turned.items()
        if (found := _parting(signals, sensors, rate, by_rates, angle))
    ]


def _parting(
    signals: Signals, sensors: Mapping[str, SensorRecord], rate: str, by_rates: Array, angle: Array
) -> LastingError | None:
    window = round(_SPAN / signals.grid.step)
    # An angle is known in the middle of a cell: from one middle to another lie the means of the cells between.
    cells = smoothed(by_rates, window)
    between = 0.5 * (cells + np.append(cells[1:], np.nan))
    means, changes = between[::window], change(angle, window)[::window] / _SPAN
    faster = change(by_rates, window)[::window] / _SPAN
    known = np.isfinite(means) & np.isfinite(changes) & np.isfinite(faster)
    beside = np.column_stack([changes, faster])[known]
    if known.sum() < _FEWEST + beside.shape[1]:
        return None
    unexplained = (means - changes)[known]
    left = unexplained - beside @ np.linalg.lstsq(beside, unexplained, rcond=1e-6)[0]
    count = left.size - beside.shape[1]
    size, expected = float(np.sqrt(left @ left / count)), _by_noise(signals, sensors, rate)
    ratio = max(size / expected, 1.0)
    return LastingError(rate, size, expected, float(count * (0.5 * (ratio**2 - 1.0) - np.log(ratio))))


def _by_noise(signals: Signals, sensors: Mapping[str, SensorRecord], rate: str) -> float:
    """Return what white noise as stated leaves of the average, rad/s."""
    angle = {"p": "phi", "q": "theta", "r": "psi"}[rate]
    of_rate, of_angle = (_stated(sensors, symbol) for symbol in (rate, angle))
    in_a_cell = max(signals.grid.step / signals.interval[angle], 1.0)
    return float(np.sqrt(of_rate**2 * signals.interval[rate] / _SPAN + 2.0 * of_angle**2 / in_a_cell / _SPAN**2))


def _stated(sensors: Mapping[str, SensorRecord], symbol: str) -> float:
    """Return the stated noise of the first sensor of a motion state, SI."""
    return next(
        float(deviation)
        for name, record in sensors.items()
        for quantity, deviation in zip(SENSORS[name], record.standard_deviation, strict=True)
        if quantity.symbol == symbol
    )


def biases_to_look_for(dataset: Dataset) -> str:
    """Name the blocks that find such errors of the gyroscope and of what estimators listen to beside it."""
    settings = dataset.experiment.identification
    if settings.attitude_from == "inertial":
        return ", ".join(("gyro", *_inertial(dataset)))
    return "gyro, attitude" if dataset.experiment.has_ahrs else "gyro"


def _inertial(dataset: Dataset) -> list[str]:
    """Name the sensors that there are of those that an AHRS hears beside the gyroscope."""
    return [name for name in INERTIAL if name in dataset.sensors]


def lasting_error_checks(dataset: Dataset, found: list[LastingError]) -> list[Check]:
    """Judge them: a note where they are more than noise."""
    biases, without = biases_to_look_for(dataset), _without_ahrs(dataset)
    return [
        judged(
            "gyroscope",
            f"errors that last in {error.rate}",
            statistic=f"{np.rad2deg(error.size):.2g} deg/s over {_SPAN:g} s beside the attitude",
            threshold=f"<= {_LARGEST:g} times {np.rad2deg(error.expected):.2g} deg/s, which the stated noise makes",
            passed=None if error.is_beyond_noise else True,
            advice=f"{error.rate} and the attitude part for seconds, more than noise as stated: look for biases "
            f"(`identification.estimate.biases: [{biases}]`, with `gyro.walk` if that of the gyroscope wanders), or "
            f"state more process noise (`auvid tune` finds how much), not less.{without}",
        )
        for error in found
    ]


def _without_ahrs(dataset: Dataset) -> str:
    """Say how to do without the attitude of an AHRS, if that is used and what it heard is recorded as well."""
    settings = dataset.experiment.identification
    raw = _inertial(dataset)
    if settings.attitude_from == "inertial" or not dataset.experiment.has_ahrs:
        return ""
    made = " An AHRS's attitude is the output of a filter, whose errors last as well"
    if "accelerometer" not in raw or len(raw) < 2:
        return f"{made}."
    return (
        f"{made}: do without it (`auvid identify DATASET --set identification.attitude_from=inertial --set "
        f"'identification.estimate.biases=[gyro, {', '.join(raw)}]'`)."
    )
