"""What lay between the inputs as they were stated and those that acted: the propeller's gain and the fins' lag."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.data.dataset import InputRecord
from auvid_cli.data.estimate import Estimate
from auvid_cli.export.terms import held_inputs, term_histories
from auvid_cli.identification.actuators import as_acting
from auvid_cli.vehicle.parameters import INPUT_SYMBOLS

Array = NDArray[np.float64]


class Actuation(NamedTuple):
    """Effect of the actuators between the inputs and the forces.

    Attributes
    ----------
    thrust : float
        How many times the stated surge force acts.
    thrust_rms : float
        Root mean square of the surge force that this adds or takes, N.
    fin_time_constant : float
        Of the first-order lag between the command and the fin, s.
    lag_rms : dict of float
        Root mean square of what the lag changes in a fin's force or moment, by coefficient, N or N m.
    """

    thrust: float
    thrust_rms: float
    fin_time_constant: float
    lag_rms: dict[str, float]


def acting_inputs(estimate: Estimate, inputs: InputRecord) -> Array:
    """Return inputs at the times of an estimate, the fins where its filter saw them, but for trims and thrust."""
    settings = estimate.experiment.identification
    acting = as_acting(inputs, settings)
    return held_inputs(estimate.time, acting.time, acting.values)


def actuation(estimate: Estimate, inputs: InputRecord, coefficients: Mapping[str, float], motion: Array) -> Actuation:
    """Return gain and lag of an estimate, sized along its motion.

    Parameters
    ----------
    estimate : Estimate
    inputs : InputRecord
        As stated.
    coefficients : mapping
        All by symbol, SI.
    motion : ndarray, shape (n, 9)
        At the times of the estimate.
    """
    commanded = held_inputs(estimate.time, inputs.time, inputs.values)
    of_vehicle, acting = estimate.coefficient_set, acting_inputs(estimate, inputs)
    by_command, by_fin = (term_histories(of_vehicle, coefficients, motion, each) for each in (commanded, acting))
    changes = np.sqrt(np.mean((by_fin - by_command) ** 2, axis=0))
    thrust, force = estimate.final_actuators().thrust, commanded[:, INPUT_SYMBOLS.index("surge_force")]
    return Actuation(
        thrust=thrust,
        thrust_rms=float(abs(thrust - 1.0) * np.sqrt(np.mean(force**2))),
        fin_time_constant=estimate.experiment.identification.fin_time_constant,
        lag_rms={c.symbol: float(change) for c, change in zip(of_vehicle, changes, strict=True) if c.is_of_fins},
    )
