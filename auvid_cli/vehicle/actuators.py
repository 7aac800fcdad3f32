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
        """Return the inputs that act, shape (..., 4), for those that are stated."""
        rudder, elevator, surge_force, roll_moment = np.moveaxis(inputs, -1, 0)
        acting = rudder + self.rudder_trim, elevator + self.elevator_trim, self.thrust * surge_force, roll_moment
        return np.stack(acting, axis=-1)


AS_STATED = ActuatorErrors()
