"""The augmented state, Sabet et al. 2018, eq. (10): prior of the coefficients and layout of the rows."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

import numpy as np

from auvid_cli.arrays import Array
from auvid_cli.config.coefficients import Prior
from auvid_cli.config.extra_states import FURTHER_STATES, ErrorBlock
from auvid_cli.config.identification import Identification
from auvid_cli.config.vehicle import Size, VehicleSettings
from auvid_cli.data.dataset import Dataset
from auvid_cli.data.estimate_file import read_estimate
from auvid_cli.errors import DataError
from auvid_cli.vehicle.coefficients import Coefficient
from auvid_cli.vehicle.parameters import MOTION, Quantity
from auvid_cli.vehicle.rigid_body import GRAVITY

# Per radian; lift-curve slope of a short fin: about 3 at the aspect ratios of AUV fins (Hoerner, Fluid-Dynamic Lift,
# 1985, ch. 3), on a fin area of about the hull diameter squared.
_LIFT_SLOPE = 3.0
_BATTERY_VOLTAGE = 24.0  # V, typical of a small vehicle
# Standard deviation of a stated coefficient as a share of its value, where the file states none.
_DEFAULT_RELATIVE_DEVIATION = 0.5
_ORIGINS = {"vehicle": "vehicle file's", "geometry": "geometry's"}
_REMEDIES = {
    "vehicle": "state initial guesses instead, e.g. --set vehicle.coefficients.{}=...",
    "geometry": "simulate a vehicle that differs from its drawing, e.g. --set vehicle.coefficients.{}=...",
}


def natural_magnitude(coefficient: Coefficient, size: Size) -> float:
    """Return the magnitude that a coefficient would have on a plain body of this size, SI.

    Parameters
    ----------
    coefficient : Coefficient
    size : Size
        Length, diameter, density of water. No coefficient of any vehicle enters.

    Notes
    -----
    Drag is ``rho/2 C A`` with C = 1 on the frontal area for surge and on the lateral area for the cross-flow terms;
    lift and control are ``rho/2 C_L d^2``. A moment, and each rate among the signals, adds a lever as factor: half the
    length, or the diameter in the roll equation. A term with more or fewer than two velocities and rates has the same
    force at half the Froude speed ``sqrt(g l)``. A thrust counts as the drag on the frontal area at that speed. A
    propeller as wide as the hull is assumed to turn once per diameter travelled.
    """
    pressure, speed = 0.5 * size.density, 0.5 * np.sqrt(GRAVITY * size.length)
    half_length = 0.5 * size.length
    frontal = 0.25 * np.pi * size.diameter**2
    signals = coefficient.signals
    if "n" in signals:
        area = frontal
    elif _is_drag(coefficient):
        area = frontal if coefficient.row == 0 else size.length * size.diameter
    else:
        area = _LIFT_SLOPE * size.diameter**2
    lever = size.diameter if coefficient.row == 3 else half_length
    rates = sum(signal in ("p", "q", "r") for signal in signals)
    speeds = rates + sum(signal in ("u", "v", "w") for signal in signals)
    at_speed = pressure * area * lever ** (rates + (coefficient.row >= 3)) * speed ** (2 - speeds)
    at_thrust = at_speed / (pressure * frontal * speed**2) ** signals.count("thrust")
    at_revolutions = at_thrust / (speed / size.diameter) ** signals.count("n")
    return float(at_revolutions / _BATTERY_VOLTAGE ** signals.count("voltage"))


def _is_drag(coefficient: Coefficient) -> bool:
    """Whether a term is resistance, and not lift of body or fins: one velocity alone, or with a modulus."""
    if coefficient.group != "term":
        return coefficient.group == "damping"
    moving = [signal for signal in coefficient.signals if signal in "uvwpqr"]
    return len(moving) == len(coefficient.signals) and (len(moving) == 1 or any(coefficient.moduli))


class CoefficientPrior(NamedTuple):
    """Prior mean and standard deviation of a coefficient, SI."""

    mean: float
    standard_deviation: float


def coefficient_priors(vehicle: VehicleSettings, prior: Prior) -> dict[str, CoefficientPrior]:
    """Return the prior of each coefficient by symbol.

    Parameters
    ----------
    vehicle : VehicleSettings
        Its coefficients and its geometry are used only if `prior.mean` names them; the prior that one of its terms
        states is always used. A coefficient without a value, or with the value zero and no standard deviation, has zero
        mean and its natural magnitude times `prior.factor`.
    prior : Prior
    """
    means: Mapping[str, float] = {}
    deviations: Mapping[str, float] = {}
    if prior.mean == "vehicle":
        means, deviations = vehicle.stated_coefficients(), vehicle.stated_deviations()
    elif prior.mean == "geometry":
        derived = vehicle.derived_values()
        means, deviations = {d.name: d.mean for d in derived}, {d.name: d.standard_deviation for d in derived}
    priors = {}
    for coefficient in vehicle.coefficient_set:
        symbol, guess = coefficient.symbol, vehicle.term_prior(coefficient.symbol)
        mean = means.get(symbol, 0.0) if guess.mean is None else guess.mean
        share = prior.relative
        if isinstance(share, dict):
            share = share.get(symbol, share.get(coefficient.group))
        stated = guess.standard_deviation or (deviations.get(symbol) if share is None else None)
        relative = abs(mean) * (_DEFAULT_RELATIVE_DEVIATION if share is None else share)
        natural = prior.factor * natural_magnitude(coefficient, vehicle.size)
        deviation = prior.standard_deviation.get(symbol) or stated or relative or natural
        priors[symbol] = CoefficientPrior(mean, deviation)
    return priors


def refuse_simulated(dataset: Dataset, means: Mapping[str, float], source: str) -> None:
    """Refuse a prior mean that equals the coefficients with which the data were simulated.

    Parameters
    ----------
    dataset : Dataset
    means : mapping
        Prior means of the estimated coefficients by symbol, SI.
    source : str
        Origin of the means, a value of `Prior.mean`.

    Raises
    ------
    DataError
    """
    if same := dataset.simulated_with(means):
        raise DataError(
            f"identification.prior.mean={source}: the data were simulated with the {_ORIGINS[source]} own "
            f"{', '.join(same)}, so the prior is the truth and the result proves nothing; "
            f"{_REMEDIES[source].format(same[0])}"
        )


def earlier_gaussian(
    path: Path, dataset: Dataset, estimated: Sequence[str], scale: Array, otherwise: Array
) -> tuple[Array, Array]:
    """Return the posterior of an earlier estimate as a prior, in units of `scale`.

    Parameters
    ----------
    path : pathlib.Path
        Estimate file.
    dataset : Dataset
        Data to identify.
    estimated : sequence of str
        Symbols.
    scale : ndarray, shape (p,)
        Prior standard deviations, SI.
    otherwise : ndarray, shape (p,)
        Prior mean of coefficients that the earlier estimate does not have, in units of `scale`.

    Returns
    -------
    mean : ndarray, shape (p,)
    factor : ndarray, shape (p, p)
        Lower triangular square root of the covariance.

    Raises
    ------
    DataError
        If the estimate is of the same data or was not completed.
    FileError
        If it is not readable.
    """
    where, earlier = f"identification.prior.from_estimate: {path}", read_estimate(path)
    if not earlier.completed:
        raise DataError(f"{where}: {earlier.status}; expected a completed estimate")
    if earlier.dataset_sha256 and earlier.dataset_sha256 == dataset.sha256:
        raise DataError(
            f"{where} was made from this very dataset, which would count twice; name an estimate of other data"
        )
    mean, covariance = otherwise.copy(), np.eye(scale.size)
    rows = [i for i, symbol in enumerate(estimated) if symbol in earlier.state]
    earlier_rows = [earlier.state.index(estimated[i]) for i in rows]
    mean[rows] = earlier.mean[-1, earlier_rows] / scale[rows]
    covariance[np.ix_(rows, rows)] = earlier.covariance[np.ix_(earlier_rows, earlier_rows)] / np.outer(
        scale[rows], scale[rows]
    )
    try:
        return mean, np.asarray(np.linalg.cholesky(covariance), dtype=np.float64)
    except np.linalg.LinAlgError:
        raise DataError(f"{where}: the covariance is not positive definite") from None


@dataclass(frozen=True)
class StateBlock:
    """Components of the augmented state that belong together."""

    name: str
    quantities: tuple[Quantity, ...]  # symbol, SI unit and meaning of each component
    # Prior standard deviation of each component, SI; about the first measurement if `starts_as_measured`
    prior_std: tuple[float, ...]
    # Square root of the power spectral density of the noise that drives each, SI; empty for parameters
    noise_density: tuple[float, ...] = ()
    prior_mean: tuple[float, ...] = ()  # SI; empty if zero or measured
    scaled: bool = False  # whether filters see each as a multiple of its `prior_std`. Coefficients span 1e-3 to 1e3.
    starts_as_measured: bool = False  # whether the prior mean is the first measurement
    error: ErrorBlock | None = None  # effect of an error of a sensor or an actuator

    @property
    def is_moving(self) -> bool:
        """Whether the components are moving states, and not parameters."""
        return bool(self.noise_density)


class StateLayout:
    """Order of the augmented state: parameters, then moving states.

    Parameters
    ----------
    blocks : iterable of StateBlock
        In any order.
    """

    def __init__(self, blocks: Iterable[StateBlock]) -> None:
        self.blocks = tuple(sorted(blocks, key=lambda block: block.is_moving))
        sizes = [len(block.quantities) for block in self.blocks]
        self._ends = np.cumsum([0, *sizes]).tolist()
        self._rows = {symbol: row for row, symbol in enumerate(self.symbols)}

    @cached_property
    def symbols(self) -> tuple[str, ...]:
        """Return the symbol of each component."""
        return tuple(quantity.symbol for block in self.blocks for quantity in block.quantities)

    @cached_property
    def units(self) -> tuple[str, ...]:
        """Return the SI unit of each component."""
        return tuple(quantity.unit for block in self.blocks for quantity in block.quantities)

    @cached_property
    def scale(self) -> Array:
        """Return the SI value of one unit of each component in the filters."""
        return np.concatenate(
            [block.prior_std if block.scaled else np.ones(len(block.prior_std)) for block in self.blocks]
        )

    @cached_property
    def prior_mean(self) -> Array:
        """Return the prior mean of each component, in units of `scale`; zero where it is measured."""
        return (
            np.concatenate([block.prior_mean or np.zeros(len(block.prior_std)) for block in self.blocks]) / self.scale
        )

    @cached_property
    def prior_std(self) -> Array:
        """Return the prior standard deviation of each component, in units of `scale`."""
        return np.concatenate([block.prior_std for block in self.blocks]) / self.scale

    @cached_property
    def noise_density(self) -> Array:
        """Return the square root of the power spectral density that drives each moving state."""
        return np.concatenate([block.noise_density for block in self.blocks if block.is_moving])

    @property
    def n_parameters(self) -> int:
        """Return the number of parameters."""
        return len(self.symbols) - self.noise_density.size

    def row(self, symbol: str) -> int | None:
        """Return the row of a component; None if it is not in the state."""
        return self._rows.get(symbol)

    def rows(self, symbols: Sequence[str]) -> list[int]:
        """Return the rows of components, all of them in the state."""
        return [self._rows[symbol] for symbol in symbols]

    def rows_of(self, name: str) -> slice:
        """Return the rows of a block; empty without a block of that name."""
        for block, begin, end in zip(self.blocks, self._ends, self._ends[1:], strict=False):
            if block.name == name:
                return slice(begin, end)
        return slice(0, 0)

    def moving_rows_of(self, name: str) -> slice:
        """Return the rows of a block, counted from the first moving state; empty without such a block."""
        rows, n_parameters = self.rows_of(name), self.n_parameters
        return slice(rows.start - n_parameters, rows.stop - n_parameters) if rows.stop else rows


def state_layout(settings: Identification, vehicle: VehicleSettings, measuring: Collection[str]) -> StateLayout:
    """Return the augmented state that settings ask for.

    Parameters
    ----------
    settings : Identification
    vehicle : VehicleSettings
    measuring : collection of str
        Names of the sensors in use. A quantity that only one of them measures, such as the depth, is a state only if
        that sensor is in use.
    """
    noise, initial = settings.process_noise, settings.initial_motion
    priors, estimated = coefficient_priors(vehicle, settings.prior), settings.estimated(vehicle)
    coefficients = tuple(
        Quantity(c.symbol, c.unit, c.meaning, c.equation) for c in vehicle.coefficient_set if c.symbol in estimated
    )
    motion_std = np.repeat([initial.velocity, initial.rate, initial.attitude], 3)
    blocks = [
        StateBlock(
            "coefficients",
            coefficients,
            tuple(priors[q.symbol].standard_deviation for q in coefficients),
            prior_mean=tuple(priors[q.symbol].mean for q in coefficients),
            scaled=True,
        ),
        StateBlock("motion", MOTION, tuple(motion_std.tolist()), noise.of_motion(), starts_as_measured=True),
    ]
    for name, quantity, sensor in FURTHER_STATES:
        if sensor in measuring:
            start, density = getattr(initial, name), getattr(noise, name)
            blocks.append(StateBlock(name, (quantity,), (start,), (density,), starts_as_measured=True))
    for error in settings.estimate.blocks():
        if error.is_delay:
            continue
        n = len(error.quantities)
        walk = (error.walk,) * n if error.walk > 0.0 else ()
        blocks.append(StateBlock(error.name, error.quantities, (error.prior_std,) * n, walk, error=error))
    return StateLayout(blocks)
