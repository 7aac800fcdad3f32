"""Vehicles as they may be: coefficients drawn about what is known of them."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.config.vehicle import VehicleSettings
from auvid_cli.data.estimate import Estimate
from auvid_cli.errors import ConfigError, DataError
from auvid_cli.vehicle.coefficients import DRAG_SYMBOLS

Array = NDArray[np.float64]

# Standard deviation of a value of a vehicle file that states none, as a share of it: with such vehicles the gains of a
# design were measured.
_SPREAD = 0.3


class Belief(NamedTuple):
    """What is known of the coefficients before a run.

    Attributes
    ----------
    symbols : tuple of str
    mean : ndarray, shape (m,)
        SI.
    covariance : ndarray, shape (m, m)
        Of the value, SI; where `logarithmic` of the logarithm of its size.
    logarithmic : ndarray of bool, shape (m,)
        Of those whose sign is sure.
    origin : str
        Where it comes from, in words.
    """

    symbols: tuple[str, ...]
    mean: Array
    covariance: Array
    logarithmic: NDArray[np.bool_]
    origin: str

    def draw(self, number: int, seed: Sequence[int]) -> list[dict[str, float]]:
        """Draw coefficients of so many vehicles, by symbol, SI."""
        random = np.random.default_rng(seed)
        values, directions = np.linalg.eigh(self.covariance)
        root = directions * np.sqrt(np.clip(values, 0.0, None))
        scatter = random.standard_normal((number, len(self.symbols))) @ root.T
        drawn = np.where(self.logarithmic, self.mean * np.exp(scatter * self.logarithmic), self.mean + scatter)
        return [dict(zip(self.symbols, row.tolist(), strict=True)) for row in drawn]


def belief_of_estimate(estimate: Estimate, vehicle: VehicleSettings) -> Belief:
    """Take what an estimate says; what it held is sure.

    Raises
    ------
    DataError
        If coefficients are neither in the estimate nor in the vehicle file.
    """
    symbols, known = vehicle.coefficient_set.symbols, vehicle.stated_coefficients() | estimate.final_coefficients()
    if missing := [symbol for symbol in symbols if symbol not in known]:
        raise DataError(f"neither the estimate nor the vehicle file has a value of {', '.join(missing)}")
    covariance = np.zeros((len(symbols), len(symbols)))
    estimated = [symbol for symbol in estimate.state if symbol in symbols]
    here, there = [symbols.index(symbol) for symbol in estimated], [estimate.state.index(name) for name in estimated]
    covariance[np.ix_(here, here)] = estimate.final_covariance()[np.ix_(there, there)]
    mean = np.array([known[symbol] for symbol in symbols])
    return Belief(symbols, mean, covariance, np.zeros(len(symbols), dtype=bool), f"the estimate of {estimate.filter}")


def belief_of_vehicle(vehicle: VehicleSettings, spread: float | None) -> Belief:
    """Take what a vehicle file says: its values, give or take what it states; where it has none, its shape.

    Parameters
    ----------
    vehicle : VehicleSettings
    spread : float or None
        Standard deviation as a share of each value of the file, instead of what it states.

    Raises
    ------
    ConfigError
        If it has neither a value of a coefficient nor a geometry.
    """
    stated, deviations = vehicle.stated_coefficients(), vehicle.stated_deviations()
    derived, symbols = {each.name: each for each in vehicle.derived_values()}, vehicle.coefficient_set.symbols
    if missing := [symbol for symbol in symbols if symbol not in stated and symbol not in derived]:
        raise ConfigError(
            f"vehicle {vehicle.name!r} says nothing of {', '.join(missing)}, so none like it can be drawn: name an "
            "estimate (--at FILE), describe hull and fins (vehicle.geometry), or state values"
        )
    mean, deviation, origins = np.zeros(len(symbols)), np.zeros(len(symbols)), dict[str, None]()
    for place, symbol in enumerate(symbols):
        if symbol not in stated:
            mean[place], deviation[place] = derived[symbol].mean, derived[symbol].standard_deviation
            origins["what follows from hull and fins"] = None
            continue
        mean[place] = stated[symbol]
        if spread is None and symbol in deviations:
            deviation[place] = deviations[symbol]
            origins["the standard deviations of the vehicle file"] = None
        else:
            share = _SPREAD if spread is None else spread
            deviation[place] = share * abs(mean[place])
            origins[f"{share:.0%} of the vehicle file's values"] = None
    share = np.divide(deviation, np.abs(mean), out=np.full(mean.size, np.inf), where=mean != 0.0)
    damping = np.array([symbol in DRAG_SYMBOLS for symbol in symbols])
    logarithmic = (mean != 0.0) & (damping | (share < 1.0))
    # Of a lognormal number whose median is the mean.
    variance = np.where(logarithmic, np.log1p(np.where(logarithmic, share, 0.0) ** 2), deviation**2)
    return Belief(symbols, mean, np.diag(variance), logarithmic, " and ".join(origins))


def drawn_vehicles(vehicle: VehicleSettings, belief: Belief, number: int, seed: Sequence[int]) -> list[VehicleSettings]:
    """Draw so many vehicles, alike in all but their coefficients."""
    return [vehicle.with_coefficients(drawn) for drawn in belief.draw(number, seed)]
