"""Rotation: turn rates against angles, responses to moments, excursions of headings, autocorrelated errors of rates."""

from collections.abc import Collection, Mapping
from typing import NamedTuple

import numpy as np
from scipy.ndimage import median_filter

from auvid_cli.arrays import Array
from auvid_cli.data.checks import Check
from auvid_cli.data.dataset import Dataset, SensorRecord
from auvid_cli.data.signals import rate_noise
from auvid_cli.inspection import responses
from auvid_cli.inspection.inspection import Mark, judged, mistaken_units, undetermined
from auvid_cli.inspection.kinematic_relations import (
    Regression,
    Signals,
    attitude_rates,
    attitude_window,
    change,
    derivative,
    fit,
    mean_between_middles,
    regress_relation,
    smoothed,
)
from auvid_cli.inspection.responses import AXES, RotationAxis
from auvid_cli.inspection.single_sensor import MIN_NOISE_SAMPLES, bias_instability, continuous, noise_floor
from auvid_cli.vehicle.parameters import INERTIAL, SENSORS, Quantity
from auvid_cli.vehicle.rigid_body import euler_rates

_GAIN_TOLERANCE = 0.2
_GAIN_SIGMAS = 3.0
_MIN_CORRELATION = 0.7
_MIN_SPREAD = np.deg2rad(0.3)  # rad/s, of a rate from attitude
_MIN_NOISE_RATIO = 3.0  # ratio of the spread of a rate to the part due to noise of the angle
_AGREEMENT_THRESHOLD = f"gain 1 +- {_GAIN_TOLERANCE}, correlation >= {_MIN_CORRELATION}"
_MIN_EXCURSION = np.deg2rad(3.0)
_MIN_EXCURSION_NOISE = 8.0  # smallest excursion, times the noise
_DRIFT_TIME = 12.0  # s; slower changes of the difference of two headings are drift
_EXCURSION_THRESHOLD = (
    f"<= {np.rad2deg(_MIN_EXCURSION):.2g} deg or {_MIN_EXCURSION_NOISE:g} times the noise, without drift over "
    f"{_DRIFT_TIME:g} s"
)
_HEADING_SENSORS = {"psi": "attitude", "heading": "magnetometer"}
_AVERAGING_TIME = 5.0  # s, over which rates are averaged; shorter errors count as noise
_MIN_AVERAGES = 6
_MAX_ERROR_RATIO = 2.0  # ratio of averaged errors to the part due to the stated noise
_MAX_PITCH = np.deg2rad(80.0)


def rotation_checks(signals: Signals, sensors: Mapping[str, SensorRecord], time_constant: float | None) -> list[Check]:
    """Check rates against angles about each axis, and the response to each moment.

    `sensors` are the records of the signals; `time_constant` is that of the vehicle, s, if known.
    """
    checks = []
    for axis in AXES:
        fits = responses.response_fits(signals, axis, time_constant)
        for angle, subject in ((axis.angle, "attitude"), *([("heading", "magnetometer")] if axis.rate == "r" else [])):
            relation = attitude_rates(signals, "heading" if angle == "heading" else "psi").get(axis.rate)
            if relation is not None and signals.has(axis.rate):
                window = signals.window(axis.rate, angle)
                fitted = regress_relation(signals.values[axis.rate], relation.main, relation.others, window)
                noise = _noise_of_rate(signals, sensors, angle, window)
                checks.append(_agreement(axis, angle, subject, fitted, noise, _sign_evidence(signals, axis, fits)))
            elif signals.has(axis.rate) or signals.has(angle):
                missing, sensor = (axis.rate, subject) if signals.has(angle) else (angle, "gyroscope")
                if missing != "heading":
                    name, reason = f"{axis.rate} against {angle}", f"{missing} is not measured"
                    checks.append(undetermined(sensor, name, reason, _AGREEMENT_THRESHOLD))
        checks.append(responses.response_check(signals, axis, fits))
    return checks


def _noise_of_rate(signals: Signals, sensors: Mapping[str, SensorRecord], angle: str, window: int) -> float:
    """Return the standard deviation, rad/s, of a window mean of the derivative of an angle, due to its noise."""
    record, component, quantity = _component(sensors, angle)
    values = continuous(record.values[:, component], quantity)
    floor = noise_floor(values) if values.size > MIN_NOISE_SAMPLES else 0.0
    half = attitude_window(signals, "heading" if angle == "heading" else "psi") // 2
    step = signals.grid.step
    return floor * float(np.sqrt(signals.interval[angle] / step)) * rate_noise(step, half, window)


def _component(sensors: Mapping[str, SensorRecord], symbol: str) -> tuple[SensorRecord, int, Quantity]:
    """Return the record of the first sensor that measures a symbol, and its component."""
    return next(
        (record, component, quantity)
        for name, record in sensors.items()
        for component, quantity in enumerate(SENSORS[name])
        if quantity.symbol == symbol
    )


def _sign_evidence(
    signals: Signals, axis: RotationAxis, fits: dict[str, Regression | None]
) -> dict[str, tuple[int, ...]]:
    """Return by sensor of the rate: 1 for evidence that its sign is right, -1 that it is wrong (fin, slip in turns)."""
    sideways = {"q": "w", "r": "v"}.get(axis.rate)
    evidence = [responses.response_signs(axis, fits)]
    if sideways is not None and signals.has("u", sideways):
        pivots = responses.sideslip_pivots(signals, sideways)
        evidence.append({name: 1 if ahead > 0.0 else -1 for name, ahead in pivots.items()})
    return {name: tuple(signs[name] for signs in evidence if name in signs) for name in fits}


def _agreement(
    axis: RotationAxis,
    angle: str,
    other: str,
    fitted: Regression | None,
    noise: float,
    evidence: dict[str, tuple[int, ...]],
) -> Check:
    """Check the gain of a rate on the derivative of an angle; blame the one that the motion contradicts as well."""
    name = f"{axis.rate} against {angle}"
    if fitted is None or fitted.spread < _MIN_SPREAD or _is_hidden(fitted, noise):
        reason = "too short" if fitted is None else f"too little excitation, {np.rad2deg(fitted.spread):.2g} deg/s"
        if fitted is not None and fitted.spread >= _MIN_SPREAD:
            reason += f", of which {np.rad2deg(noise):.2g} deg/s is noise of {angle}"
        advice = (
            f"The vehicle hardly turns about this axis: sign and scale of {axis.rate} and {angle} were not checked. In "
            "the next log, turn more about it."
        )
        return undetermined("gyroscope", name, reason, _AGREEMENT_THRESHOLD, advice)
    agrees = (
        fitted.correlation >= _MIN_CORRELATION
        and abs(fitted.gain - 1.0) <= _GAIN_TOLERANCE + _GAIN_SIGMAS * fitted.error
    )
    by_gyroscope, by_angle = evidence.get("gyroscope", ()), evidence.get("attitude", ())
    undecided = {*by_gyroscope} == {-1, 1}
    angle_is_wrong = angle == "heading" or (sum(by_angle) < 0 and sum(by_gyroscope) > 0)
    subject = other if fitted.gain < 0.0 and angle_is_wrong and not sum(by_gyroscope) < 0 else "gyroscope"
    return judged(
        subject,
        name,
        statistic=f"gain {fitted.gain:.3g} +- {fitted.error:.2g}, correlation {fitted.correlation:.2g}",
        threshold=_AGREEMENT_THRESHOLD,
        passed=agrees,
        advice=_advice(fitted, axis.rate, angle, "" if undecided else subject),
    )


def _is_hidden(fitted: Regression, noise: float) -> bool:
    """Whether noise of the angle may explain a small gain or a low correlation."""
    by_noise = abs(fitted.correlation) < _MIN_CORRELATION or 0.0 < fitted.gain < 1.0
    return by_noise and fitted.spread < _MIN_NOISE_RATIO * noise


def _advice(fitted: Regression, rate: str, angle: str, subject: str) -> str:
    if abs(fitted.correlation) < _MIN_CORRELATION:
        return (
            f"{rate} and {angle} are unrelated: check for exchanged axes, a delayed or smoothed signal, and a sensor "
            "that does not measure."
        )
    advice = []
    if fitted.gain < 0.0 and not subject:
        advice.append(
            f"The sign of {rate} or of {angle} is wrong. The fin supports one and the slip in turns the other, so "
            "another sign is wrong too. Only the manuals of the sensors tell the vehicle from its mirror image: check "
            "their frames."
        )
    elif fitted.gain < 0.0:
        wrong = rate if subject == "gyroscope" else angle
        advice.append(
            f"The sign of {wrong} is wrong, or its axes are not x forward, y starboard, z down: correct `sign` or "
            "`frame` in the map."
        )
    size = abs(fitted.gain)
    if abs(size - 1.0) > _GAIN_TOLERANCE:
        advice.append(
            mistaken_units(size, (rate, "rad/s"), (angle, "rad"))
            or f"{rate} is {size:.3g} times the rate from {angle}: check units and scales in the map, and that both "
            "are about the same axis."
        )
    return " ".join(advice) or "Find out which one is right before you use both."


def stability_checks(signals: Signals) -> list[Check]:
    """Report the bias instability of each rate, from its difference to the rate from attitude."""
    checks = []
    for symbol, relation in attitude_rates(signals).items():
        if signals.has(symbol):
            unexplained = signals.values[symbol] - relation.total()
            instability = bias_instability(unexplained[np.isfinite(unexplained)], signals.grid.step)
            if instability is not None:
                value, time = instability
                checks.append(
                    judged(
                        "gyroscope",
                        f"bias instability of {symbol}",
                        statistic=f"{np.rad2deg(value) * 3600.0:.3g} deg/h at {time:.3g} s",
                        threshold="Allan deviation of the difference to the rate from attitude",
                        passed=True,
                        advice="",
                    )
                )
    return checks


def excursion_checks(signals: Signals, stepped: Collection[str]) -> tuple[list[Check], list[Mark]]:
    """Check headings for excursions from the integrated turn rate; without one, check psi against the other heading.

    A heading in `stepped` already failed for its steps. One that does not turn like its reference fails elsewhere.
    """
    headings = [symbol for symbol in _HEADING_SENSORS if signals.has(symbol) and symbol not in stepped]
    integrated = _integrated_yaw(signals)
    if integrated is not None:
        pairs = [(symbol, "integrated r", integrated) for symbol in headings]
    elif len(headings) == len(_HEADING_SENSORS):
        pairs = [("psi", "heading", signals.values["heading"])]
    else:
        reason = "neither a gyroscope nor another heading"
        return [
            undetermined(_HEADING_SENSORS[symbol], f"excursions of {symbol}", reason, _EXCURSION_THRESHOLD)
            for symbol in headings
        ], []
    checks, marks = [], []
    for symbol, name, reference in pairs:
        heading = signals.values[symbol]
        if _turn_alike(signals, heading, reference):
            spans, peaks = _excursions(signals, heading - reference)
            checks.append(_excursion_check(symbol, name, spans, peaks))
            marks += [Mark(_HEADING_SENSORS[symbol], "step", *span) for span in spans.tolist()]
    return checks, marks


def _integrated_yaw(signals: Signals) -> Array | None:
    """Return yaw from the gyroscope, rad; NaN in its gaps, with another offset after each."""
    if not signals.has("q", "r"):
        return None
    value = signals.values
    nothing = np.zeros(signals.grid.cells)
    rates = np.column_stack((nothing, value["q"], value["r"]))
    tilt = value.get("phi", nothing), value.get("theta", nothing)
    rate = euler_rates(rates, np.column_stack((*tilt, nothing)))[:, 2]
    finite = np.isfinite(rate)
    known = np.where(finite, rate, 0.0)
    # Integrated up to the middle of each cell: in a fast turn half a cell is several degrees.
    return np.where(finite, (np.cumsum(known) - 0.5 * known) * signals.grid.step, np.nan)


def _turn_alike(signals: Signals, heading: Array, reference: Array) -> bool:
    window = signals.window("psi", "heading", "r")
    rate, expected = (smoothed(derivative(angle, signals.grid.step), window) for angle in (heading, reference))
    fitted = fit(rate, expected, [], window)
    return fitted is not None and 0.5 < fitted.gain < 2.0


def _excursions(signals: Signals, difference: Array) -> tuple[Array, Array]:
    """Return first and last time, s, shape (n, 2), and peak, rad, of each excursion."""
    at = np.flatnonzero(np.isfinite(difference))
    difference = np.unwrap(difference[at])
    # Two headings differ slowly by declination and drift.
    swing = difference - median_filter(difference, round(_DRIFT_TIME / signals.grid.step), mode="nearest")
    # The noise floor instead of the spread, which many excursions would raise.
    beyond = np.abs(swing) > max(_MIN_EXCURSION, _MIN_EXCURSION_NOISE * noise_floor(difference))
    edges = np.flatnonzero(np.diff(np.concatenate([[False], beyond, [False]]).astype(np.int8)))
    begin, end = edges[::2], edges[1::2]
    peaks = np.array([swing[a:b][np.abs(swing[a:b]).argmax()] for a, b in zip(begin, end, strict=True)])
    centres = signals.grid.centres()[at]
    return np.stack([centres[begin], centres[end - 1]], axis=1), peaks


def _excursion_check(symbol: str, reference: str, spans: Array, peaks: Array) -> Check:
    statistic = "none"
    if peaks.size:
        times = ", ".join(f"{start:.4g} to {end:.4g}" for start, end in spans[:3])
        largest = peaks[np.abs(peaks).argmax()]
        statistic = (
            f"{peaks.size}, largest {np.rad2deg(largest):.3g} deg: t = {times}{' ...' if peaks.size > 3 else ''} s"
        )
    return judged(
        _HEADING_SENSORS[symbol],
        f"excursions of {symbol} from {reference}",
        statistic=statistic,
        threshold=_EXCURSION_THRESHOLD,
        passed=not peaks.size,
        advice=f"{symbol} leaves and returns although the vehicle does not turn: iron, a motor or a modem disturbs the "
        "compass. Exclude those times (`exclude` in the map), or use another source.",
    )


class RateError(NamedTuple):
    """Autocorrelated error of a rate of the gyroscope: difference to attitude, averaged over some seconds."""

    rate: str
    size: float  # root mean square, rad/s
    expected: float  # part of the root mean square due to the stated noise, rad/s
    gain: float  # increase of the log-likelihood if noise were of that size; 0 up to the stated size

    @property
    def is_significant(self) -> bool:
        """Whether it is larger than the stated noise explains."""
        return self.size > _MAX_ERROR_RATIO * self.expected


def rate_errors(signals: Signals, sensors: Mapping[str, SensorRecord]) -> list[RateError]:
    """Return the autocorrelated error of each rate, where all rates and angles are measured.

    Angles change by the rates as in Fossen (2011), eq. (2.26). The parts proportional to that change and to its
    derivative, a scale and a delay, are subtracted.
    """
    if not signals.has("p", "q", "r", "phi", "theta", "psi"):
        return []
    p, q, r, phi, theta, psi = (signals.values[symbol] for symbol in ("p", "q", "r", "phi", "theta", "psi"))
    turning = q * np.sin(phi) + r * np.cos(phi)
    level = np.where(np.abs(theta) < _MAX_PITCH, np.cos(theta), np.nan)
    by_rate = {
        "p": (p + np.sin(theta) / level * turning, phi, "phi"),
        "q": (q * np.cos(phi) - r * np.sin(phi), theta, "theta"),
        "r": (turning / level, psi, "psi"),
    }
    errors = []
    for rate, (euler_rate, angle, symbol) in by_rate.items():
        unexplained, parameters = _unexplained(signals, euler_rate, angle)
        if unexplained.size >= _MIN_AVERAGES + parameters:
            count = unexplained.size - parameters
            size = float(np.sqrt(unexplained @ unexplained / count))
            expected = _noise_of_average(signals, sensors, rate, symbol)
            ratio = max(size / expected, 1.0)
            errors.append(RateError(rate, size, expected, float(count * (0.5 * (ratio**2 - 1.0) - np.log(ratio)))))
    return errors


def _unexplained(signals: Signals, euler_rate: Array, angle: Array) -> tuple[Array, int]:
    """Return averages of an Euler rate minus the change of its angle, rad/s, and the number of fitted parameters."""
    window = round(_AVERAGING_TIME / signals.grid.step)
    means = mean_between_middles(euler_rate, window)[::window]
    changes = change(angle, window)[::window] / _AVERAGING_TIME
    second_changes = change(euler_rate, window)[::window] / _AVERAGING_TIME
    complete = np.isfinite(means) & np.isfinite(changes) & np.isfinite(second_changes)
    regressors = np.column_stack([changes, second_changes])[complete]
    difference = (means - changes)[complete]
    fitted = np.linalg.lstsq(regressors, difference, rcond=1e-6)[0]
    return difference - regressors @ fitted, regressors.shape[1]


def _noise_of_average(signals: Signals, sensors: Mapping[str, SensorRecord], rate: str, angle: str) -> float:
    """Return the standard deviation of an average from `_unexplained` due to the stated white noise, rad/s."""
    stated = (_component(sensors, symbol) for symbol in (rate, angle))
    of_rate, of_angle = (float(record.standard_deviation[component]) for record, component, _ in stated)
    in_a_cell = max(signals.grid.step / signals.interval[angle], 1.0)
    return float(
        np.sqrt(
            of_rate**2 * signals.interval[rate] / _AVERAGING_TIME + 2.0 * of_angle**2 / in_a_cell / _AVERAGING_TIME**2
        )
    )


def gyroscope_biases(dataset: Dataset) -> str:
    """Return the bias blocks that explain autocorrelated errors of the gyroscope and of the attitude in use."""
    settings = dataset.experiment.identification
    if settings.attitude_from == "inertial":
        return ", ".join(("gyro", *(name for name in INERTIAL if name in dataset.sensors)))
    return "gyro, attitude" if dataset.experiment.has_ahrs else "gyro"


def rate_error_checks(dataset: Dataset, errors: list[RateError]) -> list[Check]:
    """Return a note for each rate whose autocorrelated error is larger than the stated noise explains."""
    biases, without_ahrs = gyroscope_biases(dataset), _advice_without_ahrs(dataset)
    return [
        judged(
            "gyroscope",
            f"autocorrelated errors in {error.rate}",
            statistic=f"{np.rad2deg(error.size):.2g} deg/s over {_AVERAGING_TIME:g} s, compared with attitude",
            threshold=f"<= {_MAX_ERROR_RATIO:g} times {np.rad2deg(error.expected):.2g} deg/s, the stated noise",
            passed=None if error.is_significant else True,
            advice=f"{error.rate} and attitude differ for seconds by more than the stated noise. Estimate biases "
            f"(`identification.estimate.biases: [{biases}]`, with `gyro.walk` if the gyroscope's bias wanders), or set "
            f"more process noise (`auvid tune` finds how much), not less.{without_ahrs}",
        )
        for error in errors
    ]


def _advice_without_ahrs(dataset: Dataset) -> str:
    """Return how to identify without the attitude of an AHRS, if it is used and its inputs are recorded."""
    settings = dataset.experiment.identification
    raw = [name for name in INERTIAL if name in dataset.sensors]
    if settings.attitude_from == "inertial" or not dataset.experiment.has_ahrs:
        return ""
    reason = " The attitude of an AHRS is the output of a filter, with autocorrelated errors"
    if "accelerometer" not in raw or len(raw) < 2:
        return f"{reason}."
    return (
        f"{reason}: identify without it (`auvid identify DATASET --set identification.attitude_from=inertial --set "
        f"'identification.estimate.biases=[gyro, {', '.join(raw)}]'`)."
    )
