"""Signals that a right-handed, forward-starboard-down body and a north-east-down attitude tie to each other."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.inspection.grid import Signals, derivative, smoothed
from auvid_cli.inspection.regression import Regression, fit
from auvid_cli.vehicle.kinematics import GRAVITY

Array = NDArray[np.float64]


class Tie(NamedTuple):
    """A signal that should equal `main` plus `others`."""

    main: Array
    others: tuple[Array, ...]

    def total(self) -> Array:
        """Return the sum."""
        return sum(self.others, self.main)


def attitude_rates(signals: Signals, heading: str = "psi") -> dict[str, Tie]:
    """Return body rates by the change of attitude, Fossen (2011), eq. (2.26) inverted; by symbol.

    What stands first contains the angle about the same axis.
    """
    if not signals.has("phi", "theta", heading):
        return {}
    value, step = signals.values, signals.grid.step
    phi, theta = value["phi"], value["theta"]
    phi_dot, theta_dot, psi_dot = (derivative(value[symbol], step) for symbol in ("phi", "theta", heading))
    return {
        "p": Tie(phi_dot, (-psi_dot * np.sin(theta),)),
        "q": Tie(theta_dot * np.cos(phi), (psi_dot * np.cos(theta) * np.sin(phi),)),
        "r": Tie(psi_dot * np.cos(theta) * np.cos(phi), (-theta_dot * np.sin(phi),)),
    }


def measured_forces(signals: Signals) -> dict[str, Tie]:
    """Return specific force by the symbol of the velocity whose change it contains; needs attitude and DVL."""
    rates = attitude_rates(signals)
    if not rates or not signals.has("u", "v", "w", "fx", "fy", "fz"):
        return {}
    value = signals.values
    p, q, r = (rates[symbol].total() for symbol in "pqr")
    u, v, w, phi, theta = (value[symbol] for symbol in ("u", "v", "w", "phi", "theta"))
    u_dot, v_dot, w_dot = (derivative(each, signals.grid.step) for each in (u, v, w))
    return {
        "u": Tie(u_dot, (q * w, -r * v, GRAVITY * np.sin(theta))),
        "v": Tie(v_dot, (r * u, -p * w, -GRAVITY * np.cos(theta) * np.sin(phi))),
        "w": Tie(w_dot, (p * v, -q * u, -GRAVITY * np.cos(theta) * np.cos(phi))),
    }


def diving_speed(signals: Signals) -> Tie | None:
    """Return the depth rate by pitch and surge, by heave, and by sway; needs attitude and DVL."""
    if not signals.has("u", "v", "w", "phi", "theta"):
        return None
    value = signals.values
    phi, theta = value["phi"], value["theta"]
    by_sway, by_heave = value["v"] * np.cos(theta) * np.sin(phi), value["w"] * np.cos(theta) * np.cos(phi)
    return Tie(-value["u"] * np.sin(theta), (by_heave, by_sway))


def tied(values: Array, main: Array, others: Sequence[Array], window: int) -> Regression | None:
    """Regress the averages of signals over a window, the signals beside the main one with gains of their own."""
    # Of the others only the signs and scales of what is looked at elsewhere could be wrong.
    return fit(smoothed(values, window), smoothed(main, window), [smoothed(each, window) for each in others], window)


def swings(signals: Signals) -> dict[str, Array]:
    """Return the acceleration, by the velocity there, of a place per metre that it lies ahead of another.

    What turning adds to a rigid body's acceleration. Needs attitude.
    """
    rates = attitude_rates(signals)
    if not rates:
        return {}
    p, q, r = (signals.values.get(symbol, rates[symbol].total()) for symbol in "pqr")
    q_dot, r_dot = (derivative(each, signals.grid.step) for each in (q, r))
    return {"v": r_dot + p * q, "w": p * r - q_dot}
