"""Kinematic relations between signals of a forward-starboard-down body with a north-east-down attitude."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.data.rate_of_change import WHILE_TURNING, rate_of_change
from auvid_cli.inspection.grid import Signals, derivative, smoothed
from auvid_cli.inspection.regression import Regression, fit
from auvid_cli.vehicle.kinematics import GRAVITY

Array = NDArray[np.float64]


class Relation(NamedTuple):
    """Terms whose sum a signal equals: `main` plus `others`."""

    main: Array
    others: tuple[Array, ...]

    def total(self) -> Array:
        """Return the sum."""
        return sum(self.others, self.main)


def attitude_rates(signals: Signals, heading: str = "psi") -> dict[str, Relation]:
    """Return body rates by the change of attitude, Fossen (2011), eq. (2.26) inverted; by symbol.

    What stands first contains the angle about the same axis. Only rates about whose axis an angle is measured; another
    angle that is not is taken as zero. The changes are those over `attitude_window`.
    """
    value, step = signals.values, signals.grid.step
    level, half = np.zeros(signals.grid.cells), attitude_window(signals, heading) // 2
    phi, theta, psi = (value.get(symbol, level) for symbol in ("phi", "theta", heading))
    phi_dot, theta_dot, psi_dot = (rate_of_change(angle, step, half) for angle in (phi, theta, psi))
    relations = {
        ("p", "phi"): Relation(phi_dot, (-psi_dot * np.sin(theta),)),
        ("q", "theta"): Relation(theta_dot * np.cos(phi), (psi_dot * np.cos(theta) * np.sin(phi),)),
        ("r", heading): Relation(psi_dot * np.cos(theta) * np.cos(phi), (-theta_dot * np.sin(phi),)),
    }
    return {rate: relation for (rate, angle), relation in relations.items() if signals.has(angle)}


def attitude_window(signals: Signals, heading: str = "psi") -> int:
    """Say over how many cells a change of attitude tells a rate: a second, or a few measurements of an angle."""
    return signals.window("phi", "theta", heading, least=WHILE_TURNING)


def rates_by_sensor(signals: Signals, symbol: str) -> dict[str, Array]:
    """Return a rate as each sensor has it: "gyroscope", and "attitude", or where there is none "magnetometer"."""
    by_sensor = {"gyroscope": signals.values[symbol]} if signals.has(symbol) else {}
    for name, heading in (("attitude", "psi"), ("magnetometer", "heading")):
        rates = attitude_rates(signals, heading)
        if symbol in rates:
            return by_sensor | {name: rates[symbol].total()}
    return by_sensor


def measured_forces(signals: Signals) -> dict[str, Relation]:
    """Return specific force by the symbol of the velocity whose change it contains; needs attitude and DVL."""
    if not signals.has("phi", "theta", "psi", "u", "v", "w", "fx", "fy", "fz"):
        return {}
    rates = attitude_rates(signals)
    value = signals.values
    p, q, r = (rates[symbol].total() for symbol in "pqr")
    u, v, w, phi, theta = (value[symbol] for symbol in ("u", "v", "w", "phi", "theta"))
    u_dot, v_dot, w_dot = (derivative(each, signals.grid.step) for each in (u, v, w))
    return {
        "u": Relation(u_dot, (q * w, -r * v, GRAVITY * np.sin(theta))),
        "v": Relation(v_dot, (r * u, -p * w, -GRAVITY * np.cos(theta) * np.sin(phi))),
        "w": Relation(w_dot, (p * v, -q * u, -GRAVITY * np.cos(theta) * np.cos(phi))),
    }


def measured_depth_rate(signals: Signals) -> Array:
    """Return the change of the measured depth, m/s."""
    return derivative(signals.values["down"], signals.grid.step)


def diving_speed(signals: Signals) -> Relation | None:
    """Return the depth rate by pitch and surge, and by heave and sway as far as they and roll are measured."""
    if not signals.has("u", "theta"):
        return None
    value, level = signals.values, np.zeros(signals.grid.cells)
    phi, theta = value.get("phi", level), value["theta"]
    v, w = value.get("v", level), value.get("w", level)
    return Relation(-value["u"] * np.sin(theta), (w * np.cos(theta) * np.cos(phi), v * np.cos(theta) * np.sin(phi)))


def regress_relation(values: Array, main: Array, others: Sequence[Array], window: int) -> Regression | None:
    """Regress averages over a window on the main term of a relation; the others have gains of their own."""
    # Of the others only the signs and scales of what is looked at elsewhere could be wrong.
    return fit(smoothed(values, window), smoothed(main, window), [smoothed(each, window) for each in others], window)


def lever_arm_acceleration(signals: Signals) -> dict[str, Array]:
    """Return the acceleration that turning adds per metre of lever arm along the hull, by the symbol of the velocity.

    Empty without attitude.
    """
    rates = attitude_rates(signals)
    if len(rates) < 3:
        return {}
    p, q, r = (signals.values.get(symbol, rates[symbol].total()) for symbol in "pqr")
    q_dot, r_dot = (derivative(each, signals.grid.step) for each in (q, r))
    return {"v": r_dot + p * q, "w": p * r - q_dot}
