"""Where a filter starts in a segment of the data: parameters as known by then, motion as first measured."""

from collections.abc import Mapping

import numpy as np

from auvid_cli.filters.problem import Gaussian
from auvid_cli.identification.state_layout import StateLayout
from auvid_cli.vehicle.kinematics import rotation_matrix


def initial_gaussian(layout: StateLayout, parameters: Gaussian, measured: Mapping[str, float]) -> Gaussian:
    """Join what is known of the parameters with the moving states as they were measured first.

    Parameters
    ----------
    layout : StateLayout
    parameters : Gaussian
        Scaled coefficients and constant errors.
    measured : mapping
        What sensors measured first, by symbol, SI; the velocity is that over ground.

    Returns
    -------
    Gaussian
        Where a current is a state, the velocity is that over ground less the current, and as unsure as that.
    """
    n = layout.n_parameters
    mean, factor = np.zeros(layout.prior_std.size), np.diag(layout.prior_std)
    mean[:n], factor[:n, :n] = parameters.mean, parameters.factor
    for block in layout.blocks:
        if block.starts_as_measured:
            mean[layout.rows_of(block.name)] = [measured[quantity.symbol] for quantity in block.quantities]
    current = layout.rows_of("current")
    if current.start == current.stop:
        return Gaussian(mean, factor)
    turn = rotation_matrix(mean[layout.rows(("phi", "theta", "psi"))]).T[:, :2]
    velocity = layout.rows("uvw")
    mean[velocity] -= turn @ mean[current]
    factor[velocity] -= turn @ factor[current]
    triangle = np.linalg.qr(factor.T)[1]
    return Gaussian(mean, (triangle * np.sign(np.diagonal(triangle))[:, None]).T.copy())
