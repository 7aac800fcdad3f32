"""Where a filter starts in a stretch of the data: parameters as known by then, motion as first measured."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from auvid_cli.config.experiment import InitialMotion
from auvid_cli.filters.problem import Belief
from auvid_cli.identification.biases import DVL_ERRORS, SensorError, constant_errors, walking_errors
from auvid_cli.identification.observation import earth_in_body_axes

Array = NDArray[np.float64]


def starting_belief(
    parameters: Belief, motion: Array, depth: Sequence[float], errors: Sequence[SensorError], spread: InitialMotion
) -> Belief:
    """Join parameters, motion, depth and walking sensor errors.

    Parameters
    ----------
    parameters : Belief
        Scaled coefficients and constant sensor errors.
    motion : ndarray, shape (9,)
        As measured, the velocity over ground.
    depth : sequence of float
        m; empty if it is no state.
    errors : sequence of SensorError
    spread : InitialMotion
        Standard deviations of motion and depth.

    Returns
    -------
    Belief
        Where a current is a state, the velocity is that over ground less the current, and as unsure as that.
    """
    walking = walking_errors(errors)
    n_parameters = parameters.mean.size
    mean = np.concatenate([parameters.mean, motion, depth, np.zeros(len(walking))])
    factor = np.diag(
        [
            *np.zeros(n_parameters),
            *np.repeat([spread.velocity, spread.rate, spread.attitude], 3),
            *([spread.depth] * len(depth)),
            *(error.spread for error in walking),
        ]
    )
    factor[:n_parameters, :n_parameters] = parameters.factor
    constant = constant_errors(errors)
    places = {error.symbol: n_parameters - len(constant) + i for i, error in enumerate(constant)}
    places |= {error.symbol: mean.size - len(walking) + i for i, error in enumerate(walking)}
    current = [places[symbol] for symbol in DVL_ERRORS[2:] if symbol in places]
    if not current:
        return Belief(mean, factor)
    turn = earth_in_body_axes(motion[6:])[:, :2]
    velocity = slice(n_parameters, n_parameters + 3)
    mean[velocity] -= turn @ mean[current]
    factor[velocity] -= turn @ factor[current]
    triangle = np.linalg.qr(factor.T)[1]
    return Belief(mean, (triangle * np.sign(np.diagonal(triangle))[:, None]).T.copy())
