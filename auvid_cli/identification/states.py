"""The augmented state: its prior and the layout of its rows."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.config.coefficients import Prior
from auvid_cli.config.extra_states import FURTHER_STATES, ErrorBlock
from auvid_cli.config.identification import Identification
from auvid_cli.config.vehicle import Size, VehicleSettings
from auvid_cli.data.dataset import Dataset
from auvid_cli.data.estimate_file import read_estimate
from auvid_cli.errors import DataError
from auvid_cli.vehicle.coefficients import Coefficient
from auvid_cli.vehicle.kinematics import GRAVITY
from auvid_cli.vehicle.parameters import MOTION, Quantity

Array = NDArray[np.float64]
# Lift-curve slope of a short fin, per radian: about 3 at the aspect ratios of AUV fins (Hoerner,
# Fluid-Dynamic Lift, 1985, ch. 3), on a fin area of about the hull diameter squared.
_LIFT_SLOPE = 3.0
_THRUST = ("thrust",)
# Of a small vehicle's battery, V: nothing of a hull says it.
_VOLTAGE = 24.0
_ORIGINS = {"vehicle": "vehicle file's", "geometry": "geometry's"}
_REMEDIES = {
    "vehicle": "state what was guessed, e.g. --set vehicle.coefficients.{}=...",
    "geometry": "simulate a vehicle that differs from its drawing, e.g. --set vehicle.coefficients.{}=...",
}
# Of a vehicle file's value, if nothing says how sure it is.
_RELATIVE = 0.5


def natural_magnitude(coefficient: Coefficient, size: Size) -> float:
    """Return the magnitude that a coefficient would have on a plain body of this size, SI.

    Drag is ``rho/2 C A`` with C = 1 on the frontal area for surge and on the lateral area for the
    cross-flow terms; lift and control are ``rho/2 C_L d^2``. A moment, and every rate among the
    signals, brings a lever: half the length, for roll the diameter. Where there are not two velocities or rates, it is
    so large as to make such a force at half the Froude speed ``sqrt(g l)``; a thrust counts as the drag on the frontal
    area at that, and a propeller as wide as the hull turns once while it goes as far as it is wide. The
    voltage is that of a small vehicle.

    Parameters
    ----------
    coefficient : Coefficient
    size : Size
        Length, diameter, density of water. No coefficient of any vehicle enters.
    """
    pressure, speed = 0.5 * size.density, 0.5 * np.sqrt(GRAVITY * size.length)
    half_length = 0.5 * size.length
    frontal = 0.25 * np.pi * size.diameter**2
    if "n" in coefficient.signals:
        area = frontal
    elif _is_drag(coefficient):
        area = frontal if coefficient.row == 0 else size.length * size.diameter
    else:
        area = _LIFT_SLOPE * size.diameter**2
    lever = size.diameter if coefficient.row == 3 else half_length
    turns, thrusts = (sum(signal in names for signal in coefficient.signals) for names in (("p", "q", "r"), _THRUST))
    speeds = turns + sum(signal in ("u", "v", "w") for signal in coefficient.signals)
    at_speed = pressure * area * lever ** (turns + (coefficient.row >= 3)) * speed ** (2 - speeds)
    revolutions, voltages = (coefficient.signals.count(name) for name in ("n", "voltage"))
    at_thrust = at_speed / (pressure * frontal * speed**2) ** thrusts
    return float(at_thrust / (speed / size.diameter) ** revolutions / _VOLTAGE**voltages)


def _is_drag(coefficient: Coefficient) -> bool:
    """Say whether a term is resistance, and not a lift of body or fins: one velocity alone, or with a modulus."""
    if coefficient.group != "term":
        return coefficient.group == "damping"
    moving = [signal for signal in coefficient.signals if signal in "uvwpqr"]
    return len(moving) == len(coefficient.signals) and (len(moving) == 1 or any(coefficient.moduli))


class CoefficientPrior(NamedTuple):
    """What is known of a coefficient before any data, SI."""

    mean: float
    standard_deviation: float


def coefficient_priors(vehicle: VehicleSettings, prior: Prior) -> dict[str, CoefficientPrior]:
    """Return what settings say of each coefficient before any data, by symbol.

    Parameters
    ----------
    vehicle : VehicleSettings
        Its coefficients count only where `prior.mean` asks for them, and so does its geometry; the guess that a term of
        its own states counts always. What its file does not state, or states as zero without a standard deviation, has
        zero mean and its natural magnitude times `prior.factor`.
    prior : Prior
    """
    means, known = _expected(vehicle, prior)
    priors = {}
    for coefficient in vehicle.coefficient_set:
        symbol, guess = coefficient.symbol, vehicle.term_prior(coefficient.symbol)
        mean = means.get(symbol, 0.0) if guess.mean is None else guess.mean
        share = _share(prior, coefficient)
        stated = guess.standard_deviation or (known.get(symbol) if share is None else None)
        relative = abs(mean) * (_RELATIVE if share is None else share)
        natural = prior.factor * natural_magnitude(coefficient, vehicle.size)
        deviation = prior.standard_deviation.get(symbol) or stated or relative or natural
        priors[symbol] = CoefficientPrior(mean, deviation)
    return priors


def _expected(vehicle: VehicleSettings, prior: Prior) -> tuple[Mapping[str, float], Mapping[str, float]]:
    """Return means and standard deviations from where the settings say, by symbol."""
    match prior.mean:
        case "zero":
            return {}, {}
        case "vehicle":
            return vehicle.stated_coefficients(), vehicle.stated_deviations()
        case "geometry":
            derived = vehicle.derived_values()
            return {d.name: d.mean for d in derived}, {d.name: d.standard_deviation for d in derived}


def _share(prior: Prior, coefficient: Coefficient) -> float | None:
    """Return what a user says of the standard deviation relative to the mean: of the coefficient, else of its group."""
    if isinstance(prior.relative, dict):
        return prior.relative.get(coefficient.symbol, prior.relative.get(coefficient.group))
    return prior.relative


def refuse_simulated(dataset: Dataset, priors: Mapping[str, CoefficientPrior], source: str) -> None:
    """Refuse a prior about the very coefficients with which data were simulated.

    Parameters
    ----------
    dataset : Dataset
    priors : mapping
        Of the coefficients to estimate, by symbol.
    source : str
        Where they are from, as `Prior.mean` has it.

    Raises
    ------
    DataError
        If any of the means is such a one.
    """
    if same := dataset.simulated_with({symbol: prior.mean for symbol, prior in priors.items()}):
        raise DataError(
            f"identification.prior.mean={source}: these data were simulated with the {_ORIGINS[source]} own "
            f"{', '.join(same)}, and such a prior proves nothing; {_REMEDIES[source].format(same[0])}"
        )


def earlier_gaussian(
    path: Path, dataset: Dataset, estimated: Sequence[str], scale: Array, otherwise: Array
) -> tuple[Array, Array]:
    """Return what an earlier estimate says of coefficients, in units of `scale`; others keep their prior.

    Parameters
    ----------
    path : pathlib.Path
        Estimate file.
    dataset : Dataset
        That is to be identified.
    estimated : sequence of str
        Symbols.
    scale : ndarray, shape (p,)
        Prior standard deviations.
    otherwise : ndarray, shape (p,)
        The prior's mean, in these units.

    Returns
    -------
    mean : ndarray, shape (p,)
    factor : ndarray, shape (p, p)
        Lower triangular square root of the covariance.

    Raises
    ------
    DataError
        If the estimate is of the same data, which would count twice, or did not end well.
    FileError
        If it cannot be read.
    """
    earlier = read_estimate(path)
    if not earlier.completed:
        raise DataError(f"identification.prior.from_estimate: {path} {earlier.status}; it is no prior for anything")
    if earlier.dataset_sha256 and earlier.dataset_sha256 == dataset.sha256:
        raise DataError(
            f"identification.prior.from_estimate: {path} was made from this very dataset, which would count twice; "
            "name an estimate of other data"
        )
    mean, covariance = otherwise.copy(), np.eye(scale.size)
    here = [i for i, symbol in enumerate(estimated) if symbol in earlier.state]
    there = [earlier.state.index(estimated[i]) for i in here]
    mean[here] = earlier.mean[-1, there] / scale[here]
    covariance[np.ix_(here, here)] = earlier.covariance[np.ix_(there, there)] / np.outer(scale[here], scale[here])
    try:
        return mean, np.asarray(np.linalg.cholesky(covariance), dtype=np.float64)
    except np.linalg.LinAlgError:
        message = f"identification.prior.from_estimate: the covariance in {path} is not positive definite"
        raise DataError(message) from None


@dataclass(frozen=True)
class StateBlock:
    """Components of the augmented state that belong together.

    Attributes
    ----------
    name : str
    quantities : tuple of Quantity
        Symbol, SI unit and meaning of each component.
    prior_std : tuple of float
        Standard deviation of each before any data, or about what was measured first, SI.
    noise_density : tuple of float
        Square root of the power spectral density that drives each, SI; empty for parameters.
    scaled : bool
        Whether filters see each as a multiple of its `prior_std`, as coefficients that span 1e-3 to 1e3 must be.
    starts_as_measured : bool
        Whether its prior mean is what sensors measured first, and not zero.
    error : ErrorBlock or None
        How it acts, where it is an error of a sensor or an actuator.
    """

    name: str
    quantities: tuple[Quantity, ...]
    prior_std: tuple[float, ...]
    noise_density: tuple[float, ...] = ()
    scaled: bool = False
    starts_as_measured: bool = False
    error: ErrorBlock | None = None

    @property
    def is_moving(self) -> bool:
        """Say whether its components are moving states, and not parameters."""
        return bool(self.noise_density)


class StateLayout:
    """An augmented state.

    Parameters
    ----------
    blocks : iterable of StateBlock
        In any order; parameters are put before moving states.

    Attributes
    ----------
    blocks : tuple of StateBlock
        As they stand in the state.
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
        """Return the SI value of one unit of each component, as filters see it."""
        return np.concatenate(
            [block.prior_std if block.scaled else np.ones(len(block.prior_std)) for block in self.blocks]
        )

    @cached_property
    def prior_std(self) -> Array:
        """Return the standard deviation of each component before any data, in units of `scale`."""
        return np.concatenate([block.prior_std for block in self.blocks]) / self.scale

    @cached_property
    def noise_density(self) -> Array:
        """Return the square root of the power spectral density that drives each moving state."""
        return np.concatenate([block.noise_density for block in self.blocks if block.is_moving])

    @property
    def n_parameters(self) -> int:
        """Return the number of parameters, which stand before the moving states."""
        return len(self.symbols) - self.noise_density.size

    def row(self, symbol: str) -> int | None:
        """Return where a component stands; None if it is no state."""
        return self._rows.get(symbol)

    def rows(self, symbols: Sequence[str]) -> list[int]:
        """Return where components stand that are all states."""
        return [self._rows[symbol] for symbol in symbols]

    def rows_of(self, name: str) -> slice:
        """Return where a block stands; empty if there is none of that name."""
        for block, begin, end in zip(self.blocks, self._ends, self._ends[1:], strict=False):
            if block.name == name:
                return slice(begin, end)
        return slice(0, 0)

    def moving_rows_of(self, name: str) -> slice:
        """Return where a block stands among the moving states alone; empty if there is none of that name."""
        rows, n_parameters = self.rows_of(name), self.n_parameters
        return slice(rows.start - n_parameters, rows.stop - n_parameters) if rows.stop else rows


def state_layout(settings: Identification, vehicle: VehicleSettings, measuring: Collection[str]) -> StateLayout:
    """Lay out the augmented state that settings ask for.

    Parameters
    ----------
    settings : Identification
    vehicle : VehicleSettings
        Natural magnitudes of its coefficients follow from its size.
    measuring : collection of str
        Sensors; what only one of them measures, as the depth, is a state where it does.
    """
    noise, initial = settings.process_noise, settings.initial_motion
    priors, estimated = coefficient_priors(vehicle, settings.prior), settings.estimated(vehicle)
    coefficients = tuple(
        Quantity(c.symbol, c.unit, c.meaning, c.equation) for c in vehicle.coefficient_set if c.symbol in estimated
    )
    blocks = [
        StateBlock(
            "coefficients",
            coefficients,
            tuple(priors[q.symbol].standard_deviation for q in coefficients),
            scaled=True,
        ),
        StateBlock(
            "motion",
            MOTION,
            tuple(np.repeat([initial.velocity, initial.rate, initial.attitude], 3).tolist()),
            noise.of_motion(),
            starts_as_measured=True,
        ),
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
