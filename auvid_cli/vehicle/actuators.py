"""Errors of the recorded inputs, and the parameters of actuators."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


class ActuatorErrors(NamedTuple):
    """Errors of the recorded inputs.

    Attributes
    ----------
    thrust : float
        Acting over recorded surge force.
    rudder_trim, elevator_trim : float
        Constant offset between actual and recorded deflection, rad.
    """

    thrust: float = 1.0
    rudder_trim: float = 0.0
    elevator_trim: float = 0.0

    def acting(self, inputs: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the acting inputs for recorded ones, shape (..., 4) or (..., 6)."""
        rudder, elevator, surge_force, *others = np.moveaxis(inputs, -1, 0)
        acting = rudder + self.rudder_trim, elevator + self.elevator_trim, self.thrust * surge_force, *others
        return np.stack(acting, axis=-1)


AS_STATED = ActuatorErrors()


class Actuator(NamedTuple):
    """Dynamics of a fin or the propeller; by default it follows its command at once and exactly.

    Attributes
    ----------
    dead_band : float
        Largest command without effect, rad or N.
    saturation : float
        Largest effective command, rad or N.
    rate_limit : float
        rad/s or N/s.
    time_constant : float
        Of a first-order lag, s.
    stall : float
        Largest deflection with a proportional force, rad.
    stall_slope : float
        Slope of the force beyond stall over the slope below.
    """

    dead_band: float = 0.0
    saturation: float = np.inf
    rate_limit: float = np.inf
    time_constant: float = 0.0
    stall: float = np.inf
    stall_slope: float = 0.0


IDEAL = Actuator()


class Actuators(NamedTuple):
    """Actuators in the order of the inputs; the roll moment has none."""

    rudder: Actuator = IDEAL
    elevator: Actuator = IDEAL
    thrust: Actuator = IDEAL


N_ACTUATORS = len(Actuators._fields)
