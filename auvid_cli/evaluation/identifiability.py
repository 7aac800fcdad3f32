"""Cramér-Rao bounds of the coefficients before any filter runs, and inseparable coefficients."""

from collections.abc import Collection, Mapping, Sequence
from functools import reduce
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from auvid_cli.arrays import Array
from auvid_cli.config.extra_states import BiasName, ProcessNoise
from auvid_cli.data.dataset import Dataset
from auvid_cli.errors import DataError
from auvid_cli.evaluation.accuracy import is_observed
from auvid_cli.evaluation.bounds import (
    UNSTABLE,
    DataInformation,
    information_with_process_noise,
    probable_motion,
    true_initial_motions,
    true_motion,
)
from auvid_cli.evaluation.results import (
    CLASSES,
    CoefficientBound,
    Collinear,
    FixSuggestion,
    Identifiability,
    SensorErrorBound,
)
from auvid_cli.filters.least_squares import Information
from auvid_cli.identification.information import information_at
from auvid_cli.identification.prepared_data import PreparedData, prepare
from auvid_cli.identification.run import resolve_settings
from auvid_cli.identification.states import natural_magnitude
from auvid_cli.vehicle.coefficients import CoefficientSet


class Assessed(NamedTuple):
    """A coefficient with its value and unit, and the size to which percentages refer, SI."""

    value: float
    unit: str
    size: float


_KNOWN = CLASSES[-2][0]
_MOTIONS = "surge", "sway", "heave", "roll", "pitch", "yaw"
# Errors that every vehicle at sea has.
_USUAL_ERRORS = BiasName.CURRENT, BiasName.FIN_TRIM, BiasName.BALLAST
# Correlation from which coefficients are confounded.
LARGEST_CORRELATION = 0.95


def assess_dataset(dataset: Dataset, at: Mapping[str, float] | None = None) -> Identifiability:
    """Return the bounds of a dataset at given coefficients; by default at the true ones, else at the vehicle file's.

    Raises
    ------
    DataError
        If an estimated coefficient has no value, or the simulation diverges with these values.
    """
    vehicle, settings = dataset.experiment.vehicle, dataset.experiment.identification
    of_vehicle = vehicle.coefficient_set
    coefficients = at if at is not None else dataset.known_coefficients()
    if at is not None and (unknown := [str(symbol) for symbol in at if symbol not in of_vehicle.symbols]):
        raise DataError(f"unknown coefficients: {', '.join(unknown)}; expected some of {', '.join(of_vehicle.symbols)}")
    missing = [symbol for symbol in settings.estimated(vehicle) if symbol not in coefficients]
    if missing:
        raise DataError(
            f"no value of {', '.join(missing)}; identifiability needs one of each coefficient: name an estimate that "
            "has them (--at FILE), or copy the values of a similar vehicle"
        )
    prepared = resolve_settings(prepare(dataset))
    # The true motion belongs to the true coefficients; others have their own most probable motion.
    about = probable_motion(prepared, coefficients)
    along = true_motion(prepared) if at is None else None if about is None else about.motion()
    information = information_at(prepared, coefficients, true_initial_motions(prepared), along)
    with_noise = None if about is None else information_with_process_noise(about)
    values = {
        c.symbol: Assessed(
            coefficients[c.symbol], c.unit, abs(coefficients[c.symbol]) or natural_magnitude(c, vehicle.size)
        )
        for c in of_vehicle
        if c.symbol in information.state
    }
    blocks = settings.estimate.blocks()
    prior_stds = {
        quantity.symbol: (information.state.index(quantity.symbol), block.prior_std)
        for block in blocks
        if not block.is_delay
        for quantity in block.quantities
    }
    noisy = {} if with_noise is None else with_noise.bound()
    identifiability = assess(information.by_sensor, information.growing, values, information.scale, prior_stds, noisy)
    for delay in (block for block in blocks if block.is_delay):
        # Only the bound with process noise includes delays.
        identifiability.sensor_errors[delay.name] = _error_bound(noisy.get(delay.name, np.inf), delay.prior_std)
    lost, remarks = information.lost_after, [] if dataset.truth is not None else _presumed(prepared)
    if lost is not None:
        remarks.append(f"{UNSTABLE.format(lost)}: only the data before are judged")
    stated = vehicle.stated_coefficients()
    holding = None if with_noise is None else coefficients_to_fix(with_noise, values, stated, of_vehicle)
    return identifiability._replace(
        remark=". ".join(sentence[0].upper() + sentence[1:] for sentence in remarks), holding=holding
    )


def _presumed(prepared: PreparedData) -> list[str]:
    """Return the assumptions of the bounds that a real vehicle may not meet."""
    settings, presumed = prepared.experiment.identification, []
    if settings.process_noise == ProcessNoise():
        presumed.append(
            "the process noise is that of auvid's simulations; a real vehicle has more, and its bounds are larger "
            "(--set identification.noise=estimate)"
        )
    if left_out := [name.value for name in _USUAL_ERRORS if name not in settings.estimate.biases]:
        presumed.append(f"bounds presume that there is no {' and no '.join(left_out)} (identification.estimate.biases)")
    if not settings.delays and BiasName.DELAY not in settings.estimate.biases:
        presumed.append(
            "bounds presume inputs and sensors without delay (identification.delays, or "
            "identification.estimate.biases: [delay])"
        )
    return presumed


def coefficients_to_fix(
    information: DataInformation, values: Mapping[str, Assessed], stated: Collection[str], of_vehicle: CoefficientSet
) -> FixSuggestion | None:
    """Return the coefficients to fix, the least known first, so that all others are known to 20 %.

    None if nothing has to be fixed, or if no coefficient would be left.

    Parameters
    ----------
    stated : collection of str
        Coefficients that have a value in the vehicle file.
    """
    held: list[str] = []
    percents = _percents(information, values, held)
    while percents and max(percents.values()) > _KNOWN:
        held.append(max(percents, key=percents.__getitem__))
        percents = _percents(information, values, held)
    if not held or not percents:
        return None
    kept = tuple(name for name in values if name not in held)
    rows = {coefficient.row for coefficient in of_vehicle if coefficient.symbol in kept}
    return FixSuggestion(
        tuple(name for name in values if name in held),
        kept,
        max(percents.values()),
        tuple(motion for row, motion in enumerate(_MOTIONS) if row in rows),
        tuple(name for name in values if name in held and name not in stated),
    )


def _percents(information: DataInformation, values: Mapping[str, Assessed], held: Collection[str]) -> dict[str, float]:
    bound = information.bound(held)
    return {name: 100.0 * bound[name] / value.size for name, value in values.items() if name not in held}


def assess(
    by_sensor: Mapping[str, Information],
    growing: Sequence[tuple[float, Information]],
    values: Mapping[str, Assessed],
    to_si: Array,
    prior_stds: Mapping[str, tuple[int, float]],
    noisy: Mapping[str, float] = MappingProxyType({}),
) -> Identifiability:
    """Return the bounds from information about a state whose first components are the coefficients.

    Parameters
    ----------
    by_sensor : mapping of Information
        About the joint state of all segments, see `auvid_cli.filters.problem`.
    growing : sequence of (float, Information)
        Information of all sensors after each duration, s, the whole run last; about the state of one segment.
    values : mapping of Assessed
        In the order of the state.
    to_si : ndarray, shape (n,)
        SI value of one unit of each component of the state.
    prior_stds : mapping of (int, float)
        Index in the state and prior standard deviation, SI, of each constant sensor error.
    noisy : mapping of float
        Bounds of coefficients and constant errors with process noise, SI.
    """
    n = len(values)
    value, size = (
        np.array([getattr(coefficient, name) for coefficient in values.values()]) for name in ("value", "size")
    )
    pick = np.eye(to_si.size)[:n] * to_si[:n, None]
    uncertainty = growing[-1][1].uncertainty()
    bound = uncertainty.deviation(pick)
    covariance = uncertainty.covariance(pick)
    with np.errstate(invalid="ignore", divide="ignore"):
        correlation = covariance / np.outer(bound, bound)
    percent = 100.0 * bound / size
    shares = _shares(by_sensor, n)
    names = tuple(values)
    groups = _collinear(names, value, size, covariance, correlation, percent)
    bounds = []
    for j, (name, (_, unit, _)) in enumerate(values.items()):
        best = max(shares, key=lambda sensor: shares[sensor][j])
        others = [other for group in groups if name in group.members for other in group.members if other != name]
        percent_with_noise = 100.0 * noisy.get(name, np.nan) / size[j]
        size_class = next(label for limit, label in CLASSES if np.fmax(percent[j], percent_with_noise) <= limit)
        bounds.append(
            CoefficientBound(
                name,
                unit,
                float(value[j]),
                float(bound[j]),
                float(percent[j]),
                float(percent_with_noise),
                size_class,
                best,
                float(shares[best][j]),
                ", ".join(others),
            )
        )
    growth = [(time, 100.0 * information.uncertainty().deviation(pick) / size) for time, information in growing]
    errors = {}
    for symbol, (place, prior_std) in prior_stds.items():
        row = np.zeros(to_si.size)
        row[place] = to_si[place]
        errors[symbol] = _error_bound(max(float(uncertainty.deviation(row)), noisy.get(symbol, 0.0)), prior_std)
    return Identifiability(bounds, groups, shares, correlation, growth, errors)


def _error_bound(deviation: float, prior_std: float) -> SensorErrorBound:
    """Return the bound of a sensor error, and whether the data observe it."""
    together = float(1.0 / np.hypot(1.0 / deviation, 1.0 / prior_std))
    return SensorErrorBound(deviation, prior_std, is_observed(together, prior_std))


def _shares(by_sensor: Mapping[str, Information], n: int) -> dict[str, Array]:
    """Return the shares of the information, ``c' I_s c / c' I c`` with ``c = I^-1 e``, by sensor."""
    root = reduce(Information.join, by_sensor.values()).uncertainty().root
    directions = root @ root.T[:, :n]
    squares = {name: np.square(information.factor @ directions).sum(axis=0) for name, information in by_sensor.items()}
    total = np.sum(list(squares.values()), axis=0)
    return {name: np.divide(s, total, out=np.zeros(n), where=total > 0.0) for name, s in squares.items()}


def _collinear(
    names: tuple[str, ...], value: Array, size: Array, covariance: Array, correlation: Array, percent: Array
) -> list[Collinear]:
    """Return groups of correlated coefficients with the best determined combination of each."""
    linked = np.abs(np.nan_to_num(correlation)) > LARGEST_CORRELATION
    groups, left = [], set(range(len(names)))
    while left:
        group, border = set(), {min(left)}
        while border:
            group |= border
            border = {int(j) for i in border for j in np.flatnonzero(linked[i])} - group
        left -= group
        members = sorted(j for j in group if np.isfinite(percent[j]))
        if len(members) < 2:
            continue
        sizes = size[members]
        relative = covariance[np.ix_(members, members)] / np.outer(sizes, sizes)
        _, directions = np.linalg.eigh(relative)
        weights = directions[:, 0] / sizes
        weights = weights / weights[np.argmax(np.abs(weights * sizes))]
        deviation = float(np.sqrt(weights @ covariance[np.ix_(members, members)] @ weights))
        combined = float(abs(weights @ value[members]))
        groups.append(
            Collinear(
                tuple(names[j] for j in members),
                _as_text([names[j] for j in members], weights),
                100.0 * deviation / combined if combined else np.inf,
                float(percent[members].max()),
            )
        )
    return groups


def _as_text(names: Sequence[str], weights: Array) -> str:
    """Return a linear combination as text; the largest term is first and has no factor."""
    order = sorted(range(len(names)), key=lambda j: abs(weights[j] - 1.0))
    text = names[order[0]]
    for j in order[1:]:
        text += f" {'+' if weights[j] >= 0.0 else '-'} {abs(weights[j]):.3g} {names[j]}"
    return text
