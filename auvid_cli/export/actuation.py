"""What lay between the inputs as they were stated and those that acted: the propeller's gain, and the actuators."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.config.actuators import ActuatorSettings
from auvid_cli.data.acting_inputs import as_acting
from auvid_cli.data.dataset import InputRecord
from auvid_cli.data.estimate import Estimate
from auvid_cli.export.terms import held_inputs, term_histories
from auvid_cli.vehicle.parameters import INPUT_SYMBOLS

Array = NDArray[np.float64]

_FORCE = INPUT_SYMBOLS.index("surge_force")


class Actuation(NamedTuple):
    """Effect of the actuators between the inputs and the forces.

    Attributes
    ----------
    thrust : float
        How many times the stated surge force acts.
    thrust_rms : float
        Root mean square of the surge force that this adds or takes, N.
    actuators : ActuatorSettings
        How fins and propeller follow their commands.
    changes : dict of float
        Root mean square of what that changes in the force or moment of each coefficient of an input, and in
        `surge_force`, N or N m.
    """

    thrust: float
    thrust_rms: float
    actuators: ActuatorSettings
    changes: dict[str, float]


def acting_inputs(estimate: Estimate, inputs: InputRecord) -> Array:
    """Return inputs at the times of an estimate as its filter saw them act, but for trims and the thrust's gain."""
    acting = as_acting(inputs, estimate.experiment)
    return held_inputs(estimate.time, acting.time, acting.values)


def actuation(estimate: Estimate, inputs: InputRecord, coefficients: Mapping[str, float], motion: Array) -> Actuation:
    """Return gain and actuators of an estimate, sized along its motion.

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
    by_command, by_actuator = (term_histories(of_vehicle, coefficients, motion, each) for each in (commanded, acting))
    changes = np.sqrt(np.mean((by_actuator - by_command) ** 2, axis=0))
    thrust, force = estimate.final_actuators().thrust, acting[:, _FORCE]
    of_inputs = {c.symbol: float(rms) for c, rms in zip(of_vehicle, changes, strict=True) if c.is_of_inputs}
    return Actuation(
        thrust=thrust,
        thrust_rms=float(abs(thrust - 1.0) * np.sqrt(np.mean(force**2))),
        actuators=estimate.experiment.vehicle.actuators,
        changes=of_inputs | {"surge_force": float(np.sqrt(np.mean((force - commanded[:, _FORCE]) ** 2)))},
    )
