"""The equations of motion as text: plain arithmetic that Python and MATLAB read alike."""

from typing import NamedTuple

from auvid_cli.export.heading import certainty
from auvid_cli.export.model import IdentifiedModel
from auvid_cli.export.terms import CALLED_OTHERWISE
from auvid_cli.vehicle.coefficients import EQUATION_ROWS, Coefficient, CoefficientSet
from auvid_cli.vehicle.matrices import mass_matrix
from auvid_cli.vehicle.parameters import ALL_INPUTS, INPUTS, PARAMETERS, Quantity

_RESTORING = ("W", "B", "xG", "yG", "zG", "xB", "yB", "zB")
# Coriolis forces as cross products of momentum (Kirchhoff), weight and buoyancy, propulsion.
_KNOWN = {
    "X": "r * a2 - q * a3 - excess * sin(theta) + surge_force",
    "Y": "p * a3 - r * a1 + excess * down_y",
    "Z": "q * a1 - p * a2 + excess * down_z",
    "K": "r * b2 - q * b3 + w * a2 - v * a3 + lever_y * down_z - lever_z * down_y + roll_moment",
    "M": "p * b3 - r * b1 + u * a3 - w * a1 - lever_z * sin(theta) - lever_x * down_z",
    "N": "q * b1 - p * b2 + v * a1 - u * a2 + lever_x * down_y + lever_y * sin(theta)",
}


class Constant(NamedTuple):
    """A named number of the model."""

    name: str
    value: float
    remark: str


def constants(model: IdentifiedModel) -> list[Constant]:
    """List weight, buoyancy, their centres and the coefficients, SI."""
    parameters = model.experiment.vehicle.known_parameters()
    remarks = {q.symbol: f"{q.unit}, {q.meaning}" for q in PARAMETERS}
    restoring = [Constant(symbol, parameters[symbol], remarks[symbol]) for symbol in _RESTORING]
    return restoring + [
        Constant(identifier(c.symbol), identified.value, f"{c.unit}, {c.meaning}; {certainty(identified)}")
        for c, identified in zip(model.coefficient_set, model.coefficients, strict=True)
    ]


def inputs_of(model: IdentifiedModel) -> tuple[Quantity, ...]:
    """Return what moves a model, in this order: revolutions and voltage too where terms are made of them."""
    return ALL_INPUTS if model.coefficient_set.of_propulsion else INPUTS


def mass_rows(model: IdentifiedModel) -> list[list[float]]:
    """Return rigid-body and added mass."""
    # Adding zero takes the sign off a zero.
    return (mass_matrix(model.experiment.vehicle.known_parameters()) + 0.0).tolist()


def statements(of_vehicle: CoefficientSet) -> list[str]:
    """Write assignments of the forces X to N and of the attitude rates.

    They need the constants, the motion u to theta, the inputs, and the momentum of the mass matrix, linear a1 to a3 and
    angular b1 to b3. Sabet et al. 2018, eqs. (3), (8) and (13).
    """
    return [
        "excess = W - B",
        *(f"lever_{axis} = {axis}G * W - {axis}B * B" for axis in "xyz"),
        "down_y = cos(theta) * sin(phi)",
        "down_z = cos(theta) * cos(phi)",
        *(statement for row in EQUATION_ROWS for statement in _force(row, of_vehicle)),
        "turning = q * sin(phi) + r * cos(phi)",
        "phi_rate = p + sin(theta) / cos(theta) * turning",
        "theta_rate = q * cos(phi) - r * sin(phi)",
        "psi_rate = turning / cos(theta)",
    ]


def identifier(symbol: str) -> str:
    """Write a coefficient's symbol as a name, for example ``X_uu`` for ``X_u|u|``."""
    return symbol.replace("|", "")


def _force(row: str, of_vehicle: CoefficientSet) -> list[str]:
    in_row = [c for c in of_vehicle if EQUATION_ROWS[c.row] == row]
    sums = [
        " + ".join(_term(c) for c in in_row if c.group == group) for group in dict.fromkeys(c.group for c in in_row)
    ]
    return [f"{row} = {_KNOWN[row]}", *(f"{row} = {row} + {terms}" for terms in sums)]


def _term(coefficient: Coefficient) -> str:
    names = (CALLED_OTHERWISE.get(signal, signal) for signal in coefficient.signals)
    factors = (f"abs({name})" if modulus else name for name, modulus in zip(names, coefficient.moduli, strict=True))
    return " * ".join([identifier(coefficient.symbol), *factors])
