"""Consistency of a filter with its innovations: checks and likely causes."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from scipy.linalg import solve_toeplitz
from scipy.special import chdtri

from auvid_cli.arrays import Array, release_memory
from auvid_cli.data.checks import Check
from auvid_cli.data.dataset import Dataset
from auvid_cli.data.estimate import Estimate
from auvid_cli.data.faults import LARGEST_FAULT, Cause
from auvid_cli.data.innovations import N_LAGS, NIS_WINDOW, Innovations, InnovationStatistics, InnovationSums
from auvid_cli.vehicle.parameters import INPUTS, SENSORS

# Limits of the mean NIS of a sensor, over a whole run and over any `NIS_WINDOW`. Neither chance nor an AHRS reaches
# them (400 components scatter by 0.07). The window finds a filter that lost track only early.
LARGEST_MEAN_NIS = 1.5
LARGEST_NIS_IN_WINDOW = 2.0
_FEWEST_COMPONENTS = 200
# Standard deviations within which 99 % of a Gaussian are.
_QUANTILE = 2.576
_TOLERANCE = 0.05  # of the mean NIS, beyond chance
_CONFIDENCE = 0.99
# Correlation that is allowed beyond chance (three standard deviations of a white sequence's).
_LARGEST_CORRELATION = 0.1
_LARGEST_REJECTED = 0.05
_MIN_SAMPLES = 50  # for a correlation


class SensorConsistency(NamedTuple):
    """Innovations of one sensor in one filter; a row of ``consistency.csv``."""

    filter: str
    sensor: str
    measurements: int  # measurements used
    rejected: int  # components beyond the gate, or of which a robust fit counted less than half
    mean_weight: float | None  # mean weight of the components in a robust fit; None without weights
    # Normalised innovation squared per component: 1 for a consistent filter with white noise, more if the data
    # contradict the model, less if the stated noise is larger than the scatter
    mean_nis: float
    expected_low: float  # lower end of the 99 % interval of the mean NIS of independent innovations
    expected_high: float  # upper end of it


def sensor_consistency(estimate: Estimate) -> list[SensorConsistency]:
    """Return the consistency of every sensor, in the order of the estimate."""
    results = []
    for name, innovations in estimate.innovations.items():
        sums = innovations.sums()
        components = sums.components.sum()
        # A chi-squared variable of n components has mean n and variance 2 n.
        scatter = _QUANTILE * float(np.sqrt(2.0 / components)) if components else float("nan")
        counts = sums.measurements, sums.rejected, innovations.mean_weight()
        results.append(
            SensorConsistency(estimate.filter, name, *counts, sums.mean_nis, max(1.0 - scatter, 0.0), 1.0 + scatter)
        )
    return results


def inconsistency_of(estimate: Estimate) -> str:
    """Return why innovations contradict a completed estimate; empty if they do not.

    A filter can reach the end of the data with a small covariance and coefficients that are far off. Its innovations
    then are, or were, larger than their stated variance. What errors of known quantities within their tolerances
    explain does not count.
    """
    if not estimate.completed:
        return ""
    for sensor in estimate.innovations:
        sums = estimate.statistics(sensor).sums
        if sums.squares.sum() > LARGEST_MEAN_NIS * sums.components.sum():
            return _too_large(sensor, sums.mean_nis, "")
        for start, nis in windowed_nis(sums):
            if nis > LARGEST_NIS_IN_WINDOW:
                return _too_large(sensor, nis, f" from t = {start:.0f} s on for {NIS_WINDOW:.0f} s")
    return ""


def windowed_nis(sums: InnovationSums) -> Array:
    """Return start, s, and mean NIS per component of every `NIS_WINDOW` that has enough measurements to tell.

    Returns
    -------
    ndarray, shape (k, 2)
    """
    enough = np.flatnonzero(sums.components >= _FEWEST_COMPONENTS)
    starts = sums.start + NIS_WINDOW * enough.astype(np.float64)
    return np.stack([starts, sums.squares[enough] / sums.components[enough]], axis=1).astype(np.float64)


def _too_large(sensor: str, nis: float, when: str) -> str:
    return (
        f"innovations of {sensor} are {np.sqrt(nis):.3g} times as large as expected{when} (NIS {nis:.3g}, expected 1)"
    )


def mean_nis(estimate: Estimate) -> float:
    """Return the normalised innovation squared per component, over all sensors."""
    of_sensors = [innovations.sums() for innovations in estimate.innovations.values()]
    components = sum(float(sums.components.sum()) for sums in of_sensors)
    return sum(float(sums.squares.sum()) for sums in of_sensors) / components if components else float("nan")


def innovation_checks(dataset: Dataset, estimate: Estimate) -> list[Check]:
    """Check NIS, whiteness and correlation with the inputs, sensor by sensor."""
    checks = []
    for sensor, innovations in estimate.innovations.items():
        if innovations.used().any():
            is_ahrs = sensor == "attitude" and is_from_ahrs(estimate)
            statistics = estimate.statistics(sensor)
            checks.append(_nis(estimate.filter, sensor, statistics.sums, is_ahrs))
            checks.append(_nis_in_windows(estimate.filter, sensor, statistics.sums))
            checks.append(_whiteness(estimate.filter, sensor, statistics, is_ahrs))
            if innovations.weight is not None or estimate.experiment.identification.gate is not None:
                checks.append(_outliers(estimate.filter, sensor, innovations))
            checks.append(_inputs(estimate, sensor, dataset, is_ahrs))
    return checks


def _nis(filter_name: str, sensor: str, sums: InnovationSums, is_ahrs: bool) -> Check:
    """Check the mean NIS; the stated noise of an AHRS is enlarged on purpose, so that only a large NIS counts."""
    components = int(sums.components.sum())
    nis = sums.mean_nis
    tails = 0.5 + _CONFIDENCE / 2, 0.5 - _CONFIDENCE / 2
    low, high = (float(chdtri(components, tail)) / components for tail in tails)
    is_small = nis < low - _TOLERANCE
    passed = nis <= high + _TOLERANCE if is_ahrs or not is_small else None
    too_large = (
        f"The data contradict the model or the stated noise of {sensor}: see the check `explained by noise`, and look "
        "for outliers, wrong signs and missing terms. Do not use the coefficients."
    )
    return Check.of(
        filter_name,
        sensor,
        "NIS",
        statistic=f"{nis:.4g}",
        threshold=f"{'any' if is_ahrs else f'{low:.4g}'} to {high:.4g} (chi-squared, {_CONFIDENCE:.0%}), "
        f"tolerance {_TOLERANCE}",
        passed=passed,
        advice=_overstated_noise(sensor) if is_small else too_large,
    )


def _overstated_noise(sensor: str) -> str:
    """Return the advice for noise that is stated too large, the same for all checks that it explains."""
    return (
        f"The stated noise of {sensor} is larger than its scatter: state less noise to get smaller standard deviations."
    )


def _nis_in_windows(filter_name: str, sensor: str, sums: InnovationSums) -> Check:
    windows = windowed_nis(sums)
    if not windows.size:
        windows = np.array([[sums.start, 0.0]])
    start, largest = windows[windows[:, 1].argmax()]
    return Check.of(
        filter_name,
        sensor,
        f"NIS in any {NIS_WINDOW:.0f} s",
        statistic=f"{largest:.4g} from t = {start:.6g} s on",
        threshold=f"<= {LARGEST_NIS_IN_WINDOW:g}",
        passed=bool(largest <= LARGEST_NIS_IN_WINDOW),
        advice=f"Something happened to {sensor} or to the vehicle at that time, or the filter lost track: see "
        "figures/innovations, leave that time out, reject outliers (`identification.gate`) or reduce their weight "
        "(`identification.robust=huber`, smoother and output_error), or narrow the prior.",
    )


def _outliers(filter_name: str, sensor: str, innovations: Innovations) -> Check:
    """Check the share of components that the gate rejects or that have a small weight."""
    name, what, without = "gate", "components rejected", "the gate"
    if innovations.weight is not None:
        name, what, without = "robust", "components weighted less than half", "identification.robust"
    rejected, used = innovations.sums().rejected, int(innovations.sums().components.sum())
    share = rejected / (rejected + used)
    return Check.of(
        filter_name,
        sensor,
        name,
        statistic=f"{rejected} of {rejected + used} {what}",
        threshold=f"<= {_LARGEST_REJECTED:.0%}",
        passed=True if not rejected else None if share <= _LARGEST_REJECTED else False,
        advice=f"Outliers of {sensor} were rejected. If they are many, the filter has lost track and rejects good "
        f"data: see figures/innovations, and run without {without}.",
    )


def _whiteness(filter_name: str, sensor: str, statistics: InnovationStatistics, is_ahrs: bool) -> Check:
    """Check the largest autocorrelation of the normalised innovations."""
    lags = np.arange(1, N_LAGS + 1)
    # Later lags have fewer pairs: scale each correlation to its own number.
    largest = {
        quantity.symbol: float(np.max(np.abs(correlation) * n / (n - lags)))
        for quantity, correlation, n in zip(SENSORS[sensor], *statistics.autocorrelation, strict=True)
        if n
    }
    if not largest:
        return Check.of(
            filter_name, sensor, "whiteness", statistic="too few measurements", threshold="", passed=True, advice=""
        )
    return _uncorrelated(
        filter_name,
        sensor,
        "whiteness",
        statistics.sums,
        largest,
        f"correlation over {N_LAGS} lags",
        f"Errors of {sensor} are correlated in time: standard deviations of the coefficients are too small, unless its "
        "stated noise is increased to allow for it. See `explained by noise` for likely causes.",
        is_ahrs,
    )


def _inputs(estimate: Estimate, sensor: str, dataset: Dataset, is_ahrs: bool) -> Check:
    """Check the correlation of the innovations with the latest inputs.

    Where errors within the tolerances explain a part of the innovations, their correlation is only noted.
    """
    correlations, filter_name, innovations = {}, estimate.filter, estimate.innovations[sensor]
    held = np.searchsorted(dataset.inputs.time, innovations.time, side="right") - 1
    signals = dataset.inputs.values[np.maximum(held, 0)].T.copy()
    release_memory()
    for column, quantity in enumerate(SENSORS[sensor]):
        values = _normalised(innovations, column)
        for given, signal in zip(INPUTS, signals, strict=False):
            if np.isfinite(values).sum() >= _MIN_SAMPLES and signal.std() > 0.0:
                correlations[f"{quantity.symbol} by {given.symbol}"] = abs(_correlation(values, signal))
    if not correlations:
        return Check.of(
            filter_name,
            sensor,
            "uncorrelated with inputs",
            statistic="nothing to compare",
            threshold="",
            passed=True,
            advice="",
        )
    check = _uncorrelated(
        filter_name,
        sensor,
        "uncorrelated with inputs",
        innovations.sums(),
        correlations,
        "correlation with an input",
        "The innovations depend on an input: the model of the actuator is wrong (delay, saturation, sign, a missing "
        "term; see `explained by noise`), or the filter has not converged.",
        is_ahrs,
    )
    return check._replace(passed=None) if check.passed is False and sensor in estimate.explained else check


def _uncorrelated(
    filter_name: str,
    sensor: str,
    name: str,
    sums: InnovationSums,
    correlations: dict[str, float],
    meaning: str,
    advice: str,
    is_ahrs: bool,
) -> Check:
    """Judge correlations.

    A sensor whose stated noise is more than twice its scatter only gets a note; an AHRS passes, because this is why its
    noise is enlarged.
    """
    limit = _LARGEST_CORRELATION + 3.0 / np.sqrt(sums.measurements)
    check = Check.of_values(filter_name, sensor, name, correlations, limit=limit, meaning=meaning, advice=advice)
    small = sums.squares.sum() < 0.25 * sums.components.sum()
    if check.passed is not False or not small:
        return check
    if is_ahrs:
        return check._replace(passed=True, threshold="any: its stated noise allows for this", advice="")
    return check._replace(passed=None, advice=_overstated_noise(sensor))


def _normalised(innovations: Innovations, column: int) -> Array:
    """Return innovations over their standard deviations; NaN where the variance is zero."""
    variance = innovations.variance[:, column]
    return innovations.innovation[:, column] / np.sqrt(np.where(variance > 0.0, variance, np.nan))


def _correlation(a: Array, b: Array) -> float:
    both = np.isfinite(a) & np.isfinite(b)
    a, b = a[both] - a[both].mean(), b[both] - b[both].mean()
    product = float(np.sqrt((a @ a) * (b @ b)))
    return float(a @ b) / product if product > 0.0 else 0.0


# Log-likelihood; as much as a fault that would make the estimate doubtful.
_WORTH_NAMING = 0.5 * LARGEST_FAULT**2
_MAX_CAUSES = 3
_TUNE = "`auvid tune` finds how much"
_TUNE_SENSORS = "`auvid tune --sensors` finds how much"


def likely_causes(estimate: Estimate) -> list[Cause]:
    """Return the likely causes of the innovations of an estimate, the likeliest first.

    Parameters
    ----------
    estimate : Estimate
        Preferably of the smoother, which has fault tests. A fault with score z gains z^2 / 2. It also correlates errors
        in time; if the likeliest fault explains most of that, only the gain beyond it counts.
    """
    faults = [
        Cause(0.5 * test.z**2, str(test), test.fault.remedy)
        for test in estimate.faults
        if not test.fault.is_alternative
    ]
    sensors = [(sensor, estimate.statistics(sensor)) for sensor in sensors_without_ahrs(estimate)]
    noises = [noise_cause(*of_sensor) for of_sensor in sensors]
    if any(noise.gain > _WORTH_NAMING and noise.lasts for noise in noises):
        # Innovations correlated in time need more process noise, whatever those of another sensor look like.
        noises = [noise_cause(*of_sensor, or_less_process_noise=False) for of_sensor in sensors]
    likeliest = max((fault.gain for fault in faults), default=0.0)
    noises = [
        noise._replace(gain=noise.gain - likeliest)
        if noise.lasts and likeliest < noise.gain < 2.0 * likeliest
        else noise
        for noise in noises
    ]
    likely = [cause for cause in [*faults, *noises] if cause.gain > _WORTH_NAMING]
    return sorted(likely, key=lambda cause: -cause.gain)


def causes_text(causes: list[Cause]) -> str:
    """Return the likeliest causes as text; empty if there are none."""
    return "; or ".join(map(str, causes[:_MAX_CAUSES]))


def sensors_without_ahrs(estimate: Estimate) -> Iterator[str]:
    """Yield sensors whose innovations should agree with the stated noise: all except an AHRS."""
    for sensor, innovations in estimate.innovations.items():
        if (sensor != "attitude" or not is_from_ahrs(estimate)) and innovations.used().any():
            yield sensor


def noise_cause(sensor: str, statistics: InnovationStatistics, or_less_process_noise: bool = True) -> Cause:
    """Return the noise that would explain the innovations of a sensor, and its gain in log-likelihood.

    `or_less_process_noise` allows less process noise as a cause.

    An autoregression of their own variance has over white noise of the stated one n / 2 (NIS - 1 - log NIS) by its size
    and, for each component, -n / 2 log(1 - R^2) by its memory, less the number of its coefficients (Akaike, IEEE Trans.
    Autom. Control 19(6), 1974).
    """
    sums, (correlation, samples) = statistics
    nis = sums.mean_nis
    by_size = 0.5 * float(sums.components.sum()) * (nis - 1.0 - np.log(nis)) if nis > 0.0 else 0.0
    explained = np.array([_explained_by_the_past(row) for row in correlation])
    by_memory = float(np.sum(np.maximum(-0.5 * samples * np.log1p(-explained) - N_LAGS, 0.0)))
    if nis < 1.0 and by_memory <= by_size:
        return Cause(by_size, f"noise of {sensor} that is stated too large", _TUNE_SENSORS)
    if nis >= 1.0 and by_memory <= _WORTH_NAMING:
        return Cause(by_size, f"more noise of {sensor} than stated, or more process noise", _TUNE_SENSORS)
    # White noise of another size would explain the size alone.
    gain = by_memory + by_size if nis >= 1.0 else by_memory
    if float(correlation[:, 0] @ samples) < 0.0:
        # Negative correlation: the filter overcorrects.
        or_less = ", or less process noise" if or_less_process_noise else ""
        return Cause(gain, f"more noise of {sensor} than stated{or_less}", _TUNE_SENSORS)
    lasting = f"errors of {sensor} that are correlated in time, or motion that the model does not explain"
    remedy = (
        f"more process noise ({_TUNE}), a disturbance (`auvid tune --disturbance` finds whether), or its bias "
        "(identification.estimate.biases)"
    )
    return Cause(gain, lasting, remedy, lasts=True)


def _explained_by_the_past(correlation: Array) -> float:
    """Return the share of the variance that an autoregression predicts, by the equations of Yule and Walker."""
    if not correlation.any():
        return 0.0
    weights = solve_toeplitz(np.append(1.0, correlation[:-1]), correlation)
    return float(np.clip(correlation @ weights, 0.0, 0.999))


def is_from_ahrs(estimate: Estimate) -> bool:
    """Whether the attitude of an AHRS was used."""
    return "attitude" in estimate.innovations and estimate.experiment.has_ahrs
