"""The identified model, what there was before it, and what it may be as well."""

from collections.abc import Collection, Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.data.estimate import Estimate
from auvid_cli.identification.prior import coefficient_priors
from auvid_cli.validation.initial_states import VEHICLE_ERRORS

Array = NDArray[np.float64]


class Models(NamedTuple):
    """Coefficients by symbol, SI.

    Attributes
    ----------
    identified : dict
    prior : dict or None
        Mean of the prior, None if it is not in the estimate.
    vehicle_file : dict or None
        None if the vehicle file does not state all, or states the prior.
    """

    identified: Mapping[str, float]
    prior: Mapping[str, float] | None
    vehicle_file: Mapping[str, float] | None


def models_of(estimate: Estimate) -> Models:
    """Return the models that an estimate knows of."""
    return Models(estimate.final_coefficients(), _prior(estimate), _vehicle_file(estimate))


def _prior(estimate: Estimate) -> Mapping[str, float] | None:
    estimated = [symbol for symbol in estimate.coefficient_set.symbols if symbol in estimate.state]
    settings = estimate.experiment
    if settings.identification.prior.from_estimate is None:
        priors = coefficient_priors(settings.vehicle, settings.identification.prior)
        return estimate.held | {symbol: priors[symbol].mean for symbol in estimated}
    if estimate.in_one_batch:
        return None
    # The first measurements say nothing of coefficients: there the mean is still the prior's.
    return estimate.held | {symbol: float(estimate.mean[0, estimate.state.index(symbol)]) for symbol in estimated}


def _vehicle_file(estimate: Estimate) -> Mapping[str, float] | None:
    given = estimate.experiment.vehicle.stated_coefficients()
    return given if set(given) == set(estimate.coefficient_set.symbols) else None


class Draws(NamedTuple):
    """Models that may be as well.

    Attributes
    ----------
    coefficients : ndarray, shape (count, 22 + terms)
        SI.
    errors : ndarray, shape (count, 5)
        By how much thrust, fins and ballast differ from those of the identified model, by the order of `NO_ERRORS`.
    """

    coefficients: Array
    errors: Array


def drawn_models(
    estimate: Estimate, count: int, rng: np.random.Generator, left_out: Collection[str] = ()
) -> Draws | None:
    """Draw models from the final mean and covariance of an estimate.

    Thrust, fins and ballast are drawn along with the coefficients: what data tell is often the two together, and a
    coefficient that is unsure because the ballast is, is less so beside the ballast that goes with it.

    Parameters
    ----------
    estimate : Estimate
    count : int
    rng : numpy.random.Generator
    left_out : collection of str
        Symbols of errors that are no part of the model, since they are found in each run.

    Returns
    -------
    Draws or None
        None if the covariance is not finite and positive definite.
    """
    symbols, final = estimate.coefficient_set.symbols, estimate.final_coefficients()
    known = [error.symbol in estimate.state and error.symbol not in left_out for error in VEHICLE_ERRORS]
    beside = [
        estimate.state.index(error.symbol) for error, is_drawn in zip(VEHICLE_ERRORS, known, strict=True) if is_drawn
    ]
    rows, n = [*estimate.coefficient_rows, *beside], len(estimate.coefficient_rows)
    drawn = np.tile([final[symbol] for symbol in symbols], (count, 1))
    covariance = estimate.final_covariance()[np.ix_(rows, rows)]
    variance = np.diagonal(covariance)
    if not (np.isfinite(covariance).all() and (variance > 0.0).all()):
        return None
    # Coefficients differ by orders of magnitude.
    deviation = np.sqrt(variance)
    try:
        factor = np.linalg.cholesky(covariance / np.outer(deviation, deviation))
    except np.linalg.LinAlgError:
        return None
    off = deviation * (rng.standard_normal((count, len(rows))) @ factor.T)
    drawn[:, [symbols.index(estimate.state[i]) for i in rows[:n]]] += off[:, :n]
    errors = np.zeros((count, len(VEHICLE_ERRORS)))
    errors[:, known] = off[:, n:]
    # The stated force already acts as many times as was found.
    errors[:, 0] /= estimate.final_actuators().thrust
    return Draws(drawn, errors)
