"""Whether the water moves: what a velocity over ground has across the heading, and changes with it."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.data.check import Check
from auvid_cli.inspection.grid import Signals
from auvid_cli.inspection.inspection import cannot_tell, judged
from auvid_cli.inspection.kinematic_relations import rates_by_sensor, regress_relation

Array = NDArray[np.float64]

# rad; of the flow to a vehicle whose speed through the water is that over ground.
_USUAL_SLIP = np.deg2rad(2.0)
_SIGMAS = 5.0
_NAME = "current"


class Drift(NamedTuple):
    """A current, m/s, north and east, with the standard error of both together."""

    north: float
    east: float
    error: float

    @property
    def size(self) -> float:
        """Return how fast the water is, m/s."""
        return float(np.hypot(self.north, self.east))


def carried_sideways(signals: Signals) -> tuple[Array, ...]:
    """Return what a current of 1 m/s north, and one east, adds to v; nothing where no heading is measured."""
    heading = next((signals.values[symbol] for symbol in ("psi", "heading") if signals.has(symbol)), None)
    return () if heading is None else (-np.sin(heading), np.cos(heading))


def drift(signals: Signals) -> Drift | None:
    """Find the current by v, beside the slip in turns; None if nothing is known of turns, or for too short a time."""
    directions, rates = carried_sideways(signals), rates_by_sensor(signals, "r")
    if not directions or not rates or not signals.has("u", "v"):
        return None
    window = signals.window("v", "u", "r", "psi", "heading")
    slip = next(iter(rates.values())) * signals.values["u"]
    north, east = directions
    by_north = regress_relation(signals.values["v"], north, (east, slip), window)
    by_east = regress_relation(signals.values["v"], east, (north, slip), window)
    if by_north is None or by_east is None:
        return None
    return Drift(by_north.gain, by_east.gain, float(np.hypot(by_north.error, by_east.error)))


def is_current(signals: Signals, found: Drift) -> bool:
    """Say whether it is one beyond doubt that turns the flow more than a little."""
    return found.size > _usual(signals) + _SIGMAS * found.error


def through_water(signals: Signals, found: Drift | None) -> Signals:
    """Take a current, if there is one, off velocities over ground."""
    if found is None or not is_current(signals, found):
        return signals
    by_north, by_east = carried_sideways(signals)
    u = signals.values["u"] - found.north * by_east + found.east * by_north
    v = signals.values["v"] - found.north * by_north - found.east * by_east
    return signals._replace(values=signals.values | {"u": u, "v": v})


def current_check(signals: Signals, found: Drift | None) -> Check:
    """Judge the current: where there is one, velocities over ground are not those through the water."""
    usual = _usual(signals)
    threshold = f"<= {usual:.2g} m/s, which turns the flow by {np.rad2deg(_USUAL_SLIP):.2g} deg"
    if found is None:
        return cannot_tell("dvl", _NAME, "v and heading are not known together for long enough", threshold)
    if not found.error < usual:
        return cannot_tell("dvl", _NAME, f"the heading changes too little: +- {found.error:.2g} m/s", threshold)
    towards = np.rad2deg(np.arctan2(found.east, found.north)) % 360.0
    there_is = is_current(signals, found)
    return judged(
        "dvl",
        _NAME,
        statistic=f"{found.size:.2g} +- {found.error:.2g} m/s" + (f" towards {towards:.3g} deg" if there_is else ""),
        threshold=threshold,
        passed=None if there_is else True,
        advice="Velocity over ground has a part across the heading that turns with it: the water moves. Estimate it "
        "(`identification.estimate.biases: [current]`), or what it does is taken for slip.",
    )


def _usual(signals: Signals) -> float:
    return float(np.tan(_USUAL_SLIP) * np.nanmedian(np.abs(signals.values["u"])))
