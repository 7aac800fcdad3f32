"""Time update of the square-root filter.

Parameters are constant. Their mean and their rows of S stay as they are; the odd part by their columns is
the new cross block of S, and only the few moving rows are triangularised.
"""

import numpy as np
from numba import types

from auvid_cli.compilation import compiled
from auvid_cli.filters.basis import lanes_of, n_blocks
from auvid_cli.filters.factor import triangularise
from auvid_cli.filters.problem import TIMELINE
from auvid_cli.filters.sigma_points import all_finite, collect_points, draw_points
from auvid_cli.filters.square_root_state import MODEL, STATE
from auvid_cli.filters.workspace import WORKSPACE
from auvid_cli.lanes import LANES


@compiled(types.boolean(MODEL, STATE, TIMELINE, types.int64, WORKSPACE), reassociate=True, inline=True)
def predict(model, state, timeline, event, work):
    """Move a state over the substeps that lead to an event, in place.

    Returns
    -------
    bool
        False if the result is not finite or not positive definite.
    """
    data, basis = model.data, model.basis
    n, mean, columns = state.n, state.mean, state.columns
    n_moving = data.noise_density.size
    n_parameters = n - n_moving
    m = basis.present.size
    first, last = timeline.substep_offset[event], timeline.substep_offset[event + 1]
    substep_input, substep_duration = timeline.substep_input[first:last], timeline.substep_duration[first:last]
    elapsed = 0.0
    for substep in range(substep_duration.size):
        elapsed += substep_duration[substep]
    draw_points(basis, state, n_moving, work)
    for b in range(n_blocks(basis)):
        moving, parameters = work.points[b, : n_moving * LANES], work.points[b, n_moving * LANES :]
        n_lanes = lanes_of(basis, b)
        for substep in range(substep_duration.size):
            held, duration = timeline.inputs[substep_input[substep]], substep_duration[substep]
            model.advance(moving, parameters, held, data.constants, data.selection, n_lanes, duration, work.process)

    spread, noisy = work.spread, n_moving + m + 1
    collect_points(work.points, basis, n_moving, n_moving, mean[n_parameters:n], work)
    for i in range(n_moving):
        for j in range(n_parameters):
            columns[j, n_parameters + i] = work.regression[i, j]
        for j in range(n_moving):
            spread[i, j] = work.regression[i, n_parameters + j]
        for k in range(noisy, spread.shape[1]):
            spread[i, k] = 0.0
        spread[i, noisy + i] = data.noise_density[i] * np.sqrt(elapsed)
    if not all_finite(n, mean) or not triangularise(spread, n_moving, work.lower):
        return False
    for j in range(n_moving):
        for i in range(j, n_moving):
            columns[n_parameters + j, n_parameters + i] = work.lower[i, j]
    return True
