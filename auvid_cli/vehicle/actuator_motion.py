"""Response of fins and propeller to their commands, compiled: saturation, dead band, rate limit, lag, stall.

The response depends on the commands alone, not on the state of the vehicle, so estimators compute it once in advance.
"""

import numpy as np

from auvid_cli.numerics import compiled, types
from auvid_cli.vehicle.parameters import Actuator

ACTUATOR = types.NamedUniTuple(types.float64, len(Actuator._fields), Actuator)
_vector = types.float64[::1]


@compiled()
def demanded(actuator, command):
    """Return the demanded position for a command: saturation, then dead band, rad or N."""
    return np.copysign(max(min(abs(command), actuator.saturation) - actuator.dead_band, 0.0), command)


@compiled()
def moved(actuator, position, demand, duration):
    """Return final and mean position of an actuator after a duration, s, with a constant demand, rad or N.

    It follows ``d(position)/dt = (demand - position) / time_constant`` with a rate limit. The rate is limited until the
    distance to the demand is ``rate_limit * time_constant``, and the distance decays exponentially after that. Both
    results are exact.
    """
    distance, limited, area = abs(demand - position), 0.0, 0.0
    if actuator.rate_limit < np.inf:
        limited = min(max(distance / actuator.rate_limit - actuator.time_constant, 0.0), duration)
        travel = actuator.rate_limit * limited
        area = (distance - 0.5 * travel) * limited
        distance -= travel
    free = duration - limited
    if free > 0.0:
        if actuator.time_constant > 0.0:
            decayed = -np.expm1(-free / actuator.time_constant)
            area += distance * actuator.time_constant * decayed
            distance *= 1.0 - decayed
        else:
            distance = 0.0
    sign = np.copysign(1.0, demand - position)
    return demand - sign * distance, demand - sign * area / duration


@compiled()
def effective(actuator, position):
    """Return the deflection, rad, that gives the same force on a fin that does not stall.

    The lift is piecewise linear, as in Gazebo's LiftDrag and the UUV Simulator's LiftDragTwoLines: beyond stall its
    slope is `stall_slope` times that below, until the lift is zero. The angle of attack is the deflection alone, as in
    ``u u rudder``; the flow angle at the fin is neglected.
    """
    size = abs(position)
    if size <= actuator.stall:
        return position
    return np.copysign(max(actuator.stall + actuator.stall_slope * (size - actuator.stall), 0.0), position)


@compiled(types.void(ACTUATOR, _vector, _vector, _vector))
def follow_commands(actuator, commands, durations, acting):
    """Fill in the mean effective position of an actuator during each command, from the first demanded position on."""
    position = demanded(actuator, commands[0])
    for k in range(commands.size):
        position, mean = moved(actuator, position, demanded(actuator, commands[k]), durations[k])
        acting[k] = effective(actuator, mean)
