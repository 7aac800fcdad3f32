"""How fins and propeller follow their commands, compiled: saturation, dead band, rate limit and lag, stall.

Of the commands alone, whatever the vehicle does meanwhile: estimators compute it once, ahead of all else, and no
derivative by a state changes.
"""

import numpy as np
from numba import types

from auvid_cli.numerics import compiled
from auvid_cli.vehicle.actuators import Actuator

ACTUATOR = types.NamedUniTuple(types.float64, len(Actuator._fields), Actuator)
_vector = types.float64[::1]


@compiled()
def demanded(actuator, command):
    """Return where a command sends an actuator.

    The dead zone of control engineering, behind a saturation: a command counts by what it exceeds the dead band, and
    no more than one as large as the saturation.
    """
    return np.copysign(max(min(abs(command), actuator.saturation) - actuator.dead_band, 0.0), command)


@compiled()
def moved(actuator, position, demand, duration):
    """Move an actuator towards a constant demand.

    It follows ``d(position)/dt = (demand - position) / time_constant``, no faster than the rate limit. While it is
    limited it moves in a straight line, which ends where what is left is ``rate_limit * time_constant``; from there on
    what is left decays. So both results are exact.

    Parameters
    ----------
    actuator : Actuator
    position, demand : float
        rad or N.
    duration : float
        s.

    Returns
    -------
    position, mean : float
        At the end, and over the duration.
    """
    left, limited, area = abs(demand - position), 0.0, 0.0
    if actuator.rate_limit < np.inf:
        limited = min(max(left / actuator.rate_limit - actuator.time_constant, 0.0), duration)
        way = actuator.rate_limit * limited
        area = (left - 0.5 * way) * limited
        left -= way
    free = duration - limited
    if free > 0.0:
        if actuator.time_constant > 0.0:
            gone = -np.expm1(-free / actuator.time_constant)
            area += left * actuator.time_constant * gone
            left *= 1.0 - gone
        else:
            left = 0.0
    side = np.copysign(1.0, demand - position)
    return demand - side * left, demand - side * area / duration


@compiled()
def effective(actuator, position):
    """Return the deflection that would make the force of a stalled fin if it had not stalled.

    Lift over angle of attack is drawn as two straight lines that meet at the angle of stall, as Gazebo's LiftDrag and
    the UUV Simulator's LiftDragTwoLines have it: up to there of the slope that the coefficients of the fin state, and
    beyond of `stall_slope` times that, until no force is left. Here the angle is the deflection: what the water's own
    direction at the fin adds to it belongs to the state and is left out, as it is in ``u u rudder``.
    """
    size = abs(position)
    if size <= actuator.stall:
        return position
    return np.copysign(max(actuator.stall + actuator.stall_slope * (size - actuator.stall), 0.0), position)


@compiled(types.void(ACTUATOR, _vector, _vector, _vector))
def follow_commands(actuator, commands, durations, acting):
    """Fill in what acts on the average while each command holds, of an actuator that is at rest in the first."""
    position = demanded(actuator, commands[0])
    for k in range(commands.size):
        position, mean = moved(actuator, position, demanded(actuator, commands[k]), durations[k])
        acting[k] = effective(actuator, mean)
