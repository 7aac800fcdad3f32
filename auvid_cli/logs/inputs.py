"""Inputs of the model from the fins and the propeller of a log."""

from collections.abc import Iterable, Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# What rudder and elevator, of one radian each, deflect a fin by. Positive rudder pushes the tail to starboard, positive
# elevator pushes it up. A fin of an X tail is positive if it pushes to starboard: two of them then push down.
_FINS = {
    "top": (1.0, 0.0),
    "bottom": (1.0, 0.0),
    "right": (0.0, 1.0),
    "left": (0.0, 1.0),
    "upper_right": (1.0, -1.0),
    "lower_right": (1.0, 1.0),
    "lower_left": (1.0, -1.0),
    "upper_left": (1.0, 1.0),
}


class Channel(NamedTuple):
    """A signal that is constant from each of its times to the next."""

    time: Array
    values: Array


class Mixed(NamedTuple):
    """Rudder and elevator that the fins amount to, and what they do besides: roll control, or play.

    Attributes
    ----------
    rudder, elevator : ndarray
        rad.
    rest : float
        rad, root mean square over fins and time.
    """

    rudder: Array
    elevator: Array
    rest: float


def hold(channels: Mapping[str, Channel]) -> tuple[Array, dict[str, Array]]:
    """Put channels on the union of their times, each holding its last value, from when all have begun."""
    times = [channel.time for channel in channels.values()]
    if all(np.array_equal(times[0], other) for other in times[1:]):
        return times[0], {name: channel.values for name, channel in channels.items()}
    union = np.unique(np.concatenate(times))
    union = union[union >= max(time[0] for time in times)]
    return union, {
        name: channel.values[np.searchsorted(channel.time, union, side="right") - 1]
        for name, channel in channels.items()
    }


def mix(fins: Mapping[str, Array]) -> Mixed:
    """Mix single fins to rudder and elevator: their least-squares fit, which is the mean of the fins concerned."""
    design = np.array([_FINS[name] for name in fins])
    inverse = np.linalg.pinv(design)
    rudder, elevator = (sum(w * fin for w, fin in zip(row, fins.values(), strict=True)) for row in inverse)
    squares = [
        np.mean(np.square(fin - by_rudder * rudder - by_elevator * elevator))
        for (by_rudder, by_elevator), fin in zip(design, fins.values(), strict=True)
    ]
    return Mixed(np.asarray(rudder), np.asarray(elevator), float(np.sqrt(np.mean(squares))))


def moved_by(fins: Iterable[str]) -> set[str]:
    """Say which of rudder and elevator have a part in what fins do."""
    return {name for fin in fins for name, part in zip(("rudder", "elevator"), _FINS[fin], strict=True) if part}


def propeller_thrust(revolutions: Array, speed: Array, a: float, b: float) -> Array:
    """Return the thrust a n|n| + b |n| u, N, of n revolutions per second at u m/s ahead (Fossen 2011, section 9.3)."""
    return a * revolutions * np.abs(revolutions) + b * np.abs(revolutions) * speed


def thruster_force(percent: Array, full: float) -> Array:
    """Return the thrust full x|x|, N, of a command x from -100 to 100 percent."""
    share = 0.01 * percent
    return full * share * np.abs(share)
