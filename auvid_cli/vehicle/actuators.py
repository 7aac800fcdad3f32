"""What lies between the inputs as they are stated and those that act."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


class ActuatorErrors(NamedTuple):
    """What lies between the inputs as they are stated and those that act.

    Attributes
    ----------
    thrust : float
        How many times the stated surge force acts.
    rudder_trim, elevator_trim : float
        What adds to the stated deflections, rad.
    """

    thrust: float = 1.0
    rudder_trim: float = 0.0
    elevator_trim: float = 0.0

    def acting(self, inputs: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the inputs that act, shape (..., 4) or (..., 6), for those that are stated."""
        rudder, elevator, surge_force, *others = np.moveaxis(inputs, -1, 0)
        acting = rudder + self.rudder_trim, elevator + self.elevator_trim, self.thrust * surge_force, *others
        return np.stack(acting, axis=-1)


AS_STATED = ActuatorErrors()


class Actuator(NamedTuple):
    """How a fin or the propeller follows its commands; by default at once and exactly.

    Attributes
    ----------
    dead_band, saturation : float
        Sizes of commands up to which nothing moves, and beyond which nothing more does, rad or N.
    rate_limit : float
        rad/s or N/s.
    time_constant : float
        Of a first-order lag, s.
    stall : float
        Deflection up to which a fin's force is proportional to it, rad.
    stall_slope : float
        By how much more the force grows beyond, over how much it did before.
    """

    dead_band: float = 0.0
    saturation: float = np.inf
    rate_limit: float = np.inf
    time_constant: float = 0.0
    stall: float = np.inf
    stall_slope: float = 0.0


IDEAL = Actuator()


class Actuators(NamedTuple):
    """Those of the inputs that have one, in the order of the inputs; the roll moment is taken as it is stated."""

    rudder: Actuator = IDEAL
    elevator: Actuator = IDEAL
    thrust: Actuator = IDEAL


N_ACTUATORS = len(Actuators._fields)
