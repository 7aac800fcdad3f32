"""What a dataset and an estimate must be, whoever wrote their files: shapes that fit, and numbers that can be."""

from collections.abc import Sequence

import numpy as np

from auvid_cli.config.enums import FilterName
from auvid_cli.config.units import magnitude_of
from auvid_cli.data.dataset import VECTORS, Array, Dataset, SensorRecord, TruthRecord
from auvid_cli.data.estimate import STATES, Estimate
from auvid_cli.data.faults import FaultTest
from auvid_cli.data.innovations import Innovations
from auvid_cli.vehicle.coefficients import SYMBOLS, is_name_of_term
from auvid_cli.vehicle.parameters import MOTION_SYMBOLS, SENSORS

# s, from the beginning of the data: three years.
LONGEST = 1e8
# Of the standard deviation of the measurement noise, what that of an innovation cannot be below but for rounding.
_OF_NOISE = 0.999
# Of a standard deviation, what is rounding.
_ROUNDING = 1e-6
# Of the standard deviations, what a covariance may lack in symmetry.
_ASYMMETRY = 1e-6


def check_dataset(dataset: Dataset) -> None:
    """Look at inputs, sensors and truth.

    Raises
    ------
    ValueError
        Where something cannot be.
    """
    inputs = dataset.inputs
    _check_times("/inputs", inputs.time, increasing=True)
    if not inputs.time.size:
        raise ValueError("/inputs is empty")
    _check_shapes("/inputs", (inputs.values, (inputs.time.size, len(inputs.quantities))))
    _check_finite("/inputs", inputs.values)
    for column, quantity in enumerate(inputs.quantities):
        _check_sizes(f"/inputs/{quantity.symbol}", inputs.values[:, column], quantity.unit)
    for name, record in dataset.sensors.items():
        _check_sensor(name, record)
    if dataset.truth is not None:
        _check_truth(dataset.truth)


def _check_sensor(name: str, record: SensorRecord) -> None:
    if name not in SENSORS:
        raise ValueError(f"unknown sensor {name!r}; auvid knows {', '.join(SENSORS)}")
    where, n, width = f"/sensors/{name}", record.time.size, len(SENSORS[name])
    _check_times(where, record.time, increasing=True)
    _check_shapes(where, (record.values, (n, width)), (record.standard_deviation, (width,)))
    _check_deviations(where, record.standard_deviation)
    for vector in VECTORS:
        values = np.array(getattr(record, vector.name))
        _check_shapes(f"{where}/{vector.name}", (values, (3,)))
        _check_finite(f"{where}/{vector.name}", values)
        _check_sizes(f"{where}/{vector.name}", values, vector.unit)
    for column, quantity in enumerate(SENSORS[name]):
        _check_sizes(f"{where}/{quantity.symbol}", record.values[:, column], quantity.unit)


def _check_sizes(where: str, values: Array, unit: str) -> None:
    """Refuse what no sensor reads and no actuator does; NaN stands for what is missing."""
    most = magnitude_of(unit).largest
    largest = float(np.fmax.reduce(np.abs(values), initial=0.0))
    if largest > most:
        raise ValueError(f"{where} has {largest:g} {unit}; {most:g} is beyond anything that can be")


def _check_truth(truth: TruthRecord) -> None:
    n = truth.time.size
    _check_times("/truth", truth.time, increasing=True)
    _check_shapes("/truth", *((values, (n, len(table))) for table, values in truth.tables))
    _check_finite("/truth", *(values for _, values in truth.tables), np.array(list(truth.coefficients.values())))
    if not n:
        raise ValueError("/truth needs a motion")
    if missing := [symbol for symbol in SYMBOLS if symbol not in truth.coefficients]:
        raise ValueError(f"/truth needs each coefficient of the model: there is no {', '.join(missing)}")
    if unknown := [symbol for symbol in truth.coefficients if symbol not in SYMBOLS and not is_name_of_term(symbol)]:
        raise ValueError(f"/truth has coefficients that no model knows: {', '.join(unknown)}")


def check_estimated_states(estimate: Estimate) -> None:
    """Look at the augmented state over time, its covariance, what was held and faults; not at innovations.

    Raises
    ------
    ValueError
        Where something cannot be.
    """
    n, k = estimate.time.size, len(estimate.state)
    _check_state(estimate)
    _check_times("/time", estimate.time)
    if not n:
        raise ValueError("/time is empty")
    _check_shapes(
        "the estimate", (estimate.mean, (n, k)), (estimate.standard_deviation, (n, k)), (estimate.covariance, (k, k))
    )
    _check_finite("/mean", estimate.mean)
    _check_finite("/held_value", np.array(list(estimate.held.values())))
    blind = _may_be_infinite(estimate.filter)
    _check_deviations("/standard_deviation", estimate.standard_deviation, blind)
    _check_covariance(estimate.covariance, blind)
    _check_corrected(estimate)
    for test in estimate.faults:
        _check_fault(test, estimate.coefficient_set.symbols)


def check_innovations(sensor: str, innovations: Innovations, filter_name: str) -> None:
    """Look at innovations, or some of them; NaN stands for what was missing or rejected.

    Raises
    ------
    ValueError
        Where something cannot be.
    """
    where = f"/innovations/{sensor}"
    if sensor not in SENSORS:
        raise ValueError(f"unknown sensor {sensor!r} among the innovations; auvid knows {', '.join(SENSORS)}")
    n, width = innovations.time.size, len(SENSORS[sensor])
    _check_times(where, innovations.time)
    _check_shapes(
        where,
        (innovations.innovation, (n, width)),
        (innovations.variance, (n, width)),
        (innovations.nis, (n,)),
        (innovations.standard_deviation, (width,)),
        *([] if innovations.weight is None else [(innovations.weight, (n, width))]),
    )
    if innovations.weight is not None and not ((innovations.weight > 0.0) & (innovations.weight <= 1.0)).all():
        raise ValueError(f"{where} has weights that are not between 0 and 1")
    _check_deviations(where, innovations.standard_deviation)
    _check_not_infinite(where, innovations.innovation, innovations.nis)
    if (innovations.variance < 0.0).any() or (innovations.nis < 0.0).any():
        raise ValueError(f"{where} has negative squares")
    if (innovations.nis[np.isnan(innovations.variance).all(axis=1)] > 0.0).any():
        raise ValueError(f"{where} has squares of measurements of which nothing was used")
    if not _may_be_infinite(filter_name):
        _check_not_infinite(where, innovations.variance)
        # S = H P H' + R, of which R alone is this: only a residual of a fit varies less than the noise.
        if (np.sqrt(innovations.variance) < _OF_NOISE * innovations.standard_deviation).any():
            raise ValueError(f"{where} has variances below that of the measurement noise")


def _may_be_infinite(filter_name: str) -> bool:
    """Say whether a standard deviation may be infinite, as the output-error method's is of what the data leave open."""
    return FilterName(filter_name).is_free_run_fit


def _check_state(estimate: Estimate) -> None:
    state, coefficients = estimate.state, estimate.coefficient_set
    units = STATES | coefficients.units
    for symbol, unit_of_state in zip(state, estimate.unit, strict=True):
        if symbol not in units:
            raise ValueError(f"unknown component {symbol!r} of the state")
        if unit_of_state != units[symbol]:
            raise ValueError(f"{symbol} is in {unit_of_state!r} and should be in {units[symbol]}")
    if len(set(state)) < len(state) or not set(MOTION_SYMBOLS) <= set(state):
        raise ValueError("the state does not have each component once")
    symbols = coefficients.symbols
    if sorted([*estimate.held, *(symbol for symbol in state if symbol in symbols)]) != sorted(symbols):
        raise ValueError(f"each of the {len(symbols)} coefficients must be either estimated or held")


def _check_corrected(estimate: Estimate) -> None:
    nominal = dict(zip(estimate.state, estimate.standard_deviation[-1].tolist(), strict=True))
    for symbol, deviation in estimate.corrected.items():
        if symbol not in nominal:
            raise ValueError(f"/corrected has {symbol!r}, which is no component of the state")
        if not deviation >= nominal[symbol] * (1.0 - _ROUNDING) or np.isinf(deviation) != np.isinf(nominal[symbol]):
            raise ValueError(f"/corrected has {deviation:g} for {symbol}, of which the nominal is {nominal[symbol]:g}")


def _check_fault(test: FaultTest, coefficients: Sequence[str]) -> None:
    where = f"/faults, {test.fault},"
    _check_finite(where, np.array([test.size, test.standard_deviation, test.susceptibility]))
    if test.standard_deviation <= 0.0 or test.susceptibility < 0.0:
        raise ValueError(f"{where} has a standard deviation that is not positive, or a negative susceptibility")
    if test.coefficient not in coefficients:
        raise ValueError(f"{where} moves {test.coefficient!r}, which is no coefficient")


def _check_times(where: str, time: Array, increasing: bool = False) -> None:
    if not (np.abs(time) <= LONGEST).all():
        raise ValueError(f"times of {where} are not finite, or beyond {LONGEST:.0e} s")
    steps = np.diff(time)
    if (steps <= 0.0 if increasing else steps < 0.0).any():
        raise ValueError(f"times of {where} are not {'strictly increasing' if increasing else 'in order'}")


def _check_shapes(where: str, *expected: tuple[Array, tuple[int, ...]]) -> None:
    if any(array.shape != shape for array, shape in expected):
        raise ValueError(f"variables of {where} do not fit each other in length")


def _check_finite(where: str, *arrays: Array) -> None:
    if not all(np.isfinite(array).all() for array in arrays):
        raise ValueError(f"{where} has values that are not finite")


def _check_not_infinite(where: str, *arrays: Array) -> None:
    if any(np.isinf(array).any() for array in arrays):
        raise ValueError(f"{where} has infinite values")


def _check_deviations(where: str, deviations: Array, may_be_infinite: bool = False) -> None:
    if not (deviations >= 0.0).all() or not (may_be_infinite or np.isfinite(deviations).all()):
        raise ValueError(f"standard deviations of {where} are negative or not finite")


def _check_covariance(covariance: Array, may_be_infinite: bool) -> None:
    variance = np.diagonal(covariance)
    known = variance < np.inf
    scale = np.sqrt(np.abs(variance[known]))
    part = covariance[np.ix_(known, known)]
    if np.isnan(covariance).any() or not (may_be_infinite or known.all()) or not (variance > 0.0).all():
        raise ValueError("/covariance has values that cannot be")
    if not np.isfinite(part).all() or (np.abs(part - part.T) > _ASYMMETRY * np.outer(scale, scale)).any():
        raise ValueError("/covariance is not symmetric")
