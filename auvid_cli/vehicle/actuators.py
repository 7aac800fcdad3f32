"""Errors of the recorded inputs, and the parameters of actuators."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


class ActuatorErrors(NamedTuple):
    """Errors of the recorded inputs."""

    thrust: float = 1.0  # ratio of the acting to the recorded surge force
    rudder_trim: float = 0.0  # actual minus recorded deflection, constant, rad
    elevator_trim: float = 0.0  # actual minus recorded deflection, constant, rad

    def acting(self, inputs: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the acting inputs for recorded ones, shape (..., 4) or (..., 6)."""
        rudder, elevator, surge_force, *others = np.moveaxis(inputs, -1, 0)
        acting = rudder + self.rudder_trim, elevator + self.elevator_trim, self.thrust * surge_force, *others
        return np.stack(acting, axis=-1)


AS_STATED = ActuatorErrors()


class Actuator(NamedTuple):
    """Dynamics of a fin or the propeller; by default it follows its command at once and exactly."""

    dead_band: float = 0.0  # largest command without effect, rad or N
    saturation: float = np.inf  # largest effective command, rad or N
    rate_limit: float = np.inf  # rad/s or N/s
    time_constant: float = 0.0  # time constant of a first-order lag, s
    stall: float = np.inf  # largest deflection with a proportional force, rad
    stall_slope: float = 0.0  # slope of the force beyond stall over the slope below


IDEAL = Actuator()


class Actuators(NamedTuple):
    """Actuators in the order of the inputs; the roll moment has none."""

    rudder: Actuator = IDEAL
    elevator: Actuator = IDEAL
    thrust: Actuator = IDEAL


N_ACTUATORS = len(Actuators._fields)
