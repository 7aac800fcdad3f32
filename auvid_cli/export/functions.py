"""Equations of motion as functions for Python, MATLAB and the MSS toolbox."""

from collections.abc import Sequence
from typing import NamedTuple

from auvid_cli.export.model import FACTOR_INPUTS, IdentifiedModel
from auvid_cli.export.unsupported_features import UnsupportedFeatures, certainty, heading_lines, line_comments
from auvid_cli.vehicle.coefficients import EQUATION_ROWS, Coefficient, CoefficientSet
from auvid_cli.vehicle.parameters import ALL_INPUTS, INPUTS, MOTION_SYMBOLS, PARAMETERS, Quantity
from auvid_cli.vehicle.rigid_body import mass_matrix

_RESTORING = ("W", "B", "xG", "yG", "zG", "xB", "yB", "zB")
# Coriolis forces as cross products of momentum (Kirchhoff), weight and buoyancy, propulsion.
_RIGID_BODY = {
    "X": "r * a2 - q * a3 - excess * sin(theta) + surge_force",
    "Y": "p * a3 - r * a1 + excess * down_y",
    "Z": "q * a1 - p * a2 + excess * down_z",
    "K": "r * b2 - q * b3 + w * a2 - v * a3 + lever_y * down_z - lever_z * down_y + roll_moment",
    "M": "p * b3 - r * b1 + u * a3 - w * a1 - lever_z * sin(theta) - lever_x * down_z",
    "N": "q * b1 - p * b2 + v * a1 - u * a2 + lever_x * down_y + lever_y * sin(theta)",
}
_MATLAB_HELP = """Time derivative of the motion [u v w p q r phi theta psi], SI and radians.
Body axes forward, starboard, down; angles to north, east, down.
inputs: [{inputs}], {units}.
For example: [t, x] = ode45(@(t, x) {name}(x, [{example}]), [0 10], [2 0 0 0 0 0 0 0 0]);
"""
FURTHER = ", revolutions (turn/s), voltage (V)"
_FUNCTION = '''

def motion_derivative(motion, inputs):
    """Time derivative of the motion.

    Parameters
    ----------
    motion : array_like, shape (9,)
        u, v, w (m/s), p, q, r (rad/s), phi, theta, psi (rad): body axes forward, starboard, down; angles to
        north, east, down.
    inputs : array_like, shape (INPUTS,)
        Rudder, elevator (rad), surge force (N), roll moment (N m)MORE.

    Returns
    -------
    ndarray, shape (9,)
    """
'''
_MSS_HELP = """Compatible with MATLAB and GNU Octave, in the form of the vessels of MSS (remus100 and its like):
  [xdot, U, M] = {name}(x, ui, Vc, betaVc, w_c)   3-D ocean current
  [xdot, U, M] = {name}(x, ui, Vc, betaVc)        horizontal ocean current
  [xdot, U, M] = {name}(x, ui)                    no ocean current
  x = [u v w p q r x y z phi theta psi]', SI and radians: body axes forward, starboard, down; north, east, down.
  ui = [{inputs}]', {units}; without limits.
  Vc, betaVc, w_c: speed of the current, m/s, direction to which it flows, rad, and speed down, m/s.
  xdot: derivative of x; U: speed over ground, m/s; M: rigid-body and added mass.
For example: x = rk4(@{name}, 0.02, x, ui)
"""
# Differences from the vessels of MSS itself.
MSS_NOTES = (
    "Inputs are fin angles and the thrust in newtons, without limits and rates; MSS's thrust curves are not used.",
    "The state has Euler angles, not quaternions.",
)
# Columns are the body axes in north, east, down.
_ROTATION = [
    "cphi = cos(phi); sphi = sin(phi); cth = cos(theta); sth = sin(theta); cpsi = cos(psi); spsi = sin(psi)",
    "R = [cpsi*cth, cpsi*sth*sphi - spsi*cphi, cpsi*sth*cphi + spsi*sphi; ...\n"
    "     spsi*cth, spsi*sth*sphi + cpsi*cphi, spsi*sth*cphi - cpsi*sphi; ...\n"
    "     -sth, cth*sphi, cth*cphi]",
]


class Constant(NamedTuple):
    """A named number of the model."""

    name: str
    value: float
    remark: str


def constants(model: IdentifiedModel) -> list[Constant]:
    """Return weight, buoyancy, their centres and the coefficients, SI."""
    parameters = model.experiment.vehicle.known_parameters()
    remarks = {q.symbol: f"{q.unit}, {q.meaning}" for q in PARAMETERS}
    restoring = [Constant(symbol, parameters[symbol], remarks[symbol]) for symbol in _RESTORING]
    return restoring + [
        Constant(identifier(c.symbol), identified.value, f"{c.unit}, {c.meaning}; {certainty(identified)}")
        for c, identified in zip(model.coefficient_set, model.coefficients, strict=True)
    ]


def _fin_signs(model: IdentifiedModel) -> list[str]:
    """Return how the vehicle turns with a positive angle of each fin, by the signs of the moments."""
    values = {coefficient.symbol: coefficient.value for coefficient in model.coefficients}
    effects = ("rudder", "N_uudr", "to starboard", "to port"), ("elevator", "M_uude", "up", "down")
    turns = [
        f"a positive {fin} turns the bow {positive if values[symbol] > 0.0 else negative}"
        for fin, symbol, positive, negative in effects
        if values.get(symbol)
    ]
    return [f"Signs of the fins, moving forwards: {'; '.join(turns)}."] if turns else []


def inputs_of(model: IdentifiedModel) -> tuple[Quantity, ...]:
    """Return the inputs of a model; revolutions and voltage only if terms depend on them."""
    return ALL_INPUTS if model.coefficient_set.of_propulsion else INPUTS


def mass_rows(model: IdentifiedModel) -> list[list[float]]:
    """Return the rows of the mass matrix: rigid-body plus added mass."""
    # Adding zero turns -0.0 into 0.0.
    return (mass_matrix(model.experiment.vehicle.known_parameters()) + 0.0).tolist()


def statements(coefficient_set: CoefficientSet) -> list[str]:
    """Return assignments of the forces X to N and of the attitude rates, Sabet et al. 2018, eqs. (3), (8) and (13).

    They need the constants, the motion u to theta, the inputs, and the momentum: linear a1 to a3, angular b1 to b3.
    """
    return [
        "excess = W - B",
        *(f"lever_{axis} = {axis}G * W - {axis}B * B" for axis in "xyz"),
        "down_y = cos(theta) * sin(phi)",
        "down_z = cos(theta) * cos(phi)",
        *(statement for row in EQUATION_ROWS for statement in _force(row, coefficient_set)),
        "turning = q * sin(phi) + r * cos(phi)",
        "phi_rate = p + sin(theta) / cos(theta) * turning",
        "theta_rate = q * cos(phi) - r * sin(phi)",
        "psi_rate = turning / cos(theta)",
    ]


def identifier(symbol: str) -> str:
    """Return a symbol as an identifier, for example ``X_uu`` for ``X_u|u|``."""
    return symbol.replace("|", "")


def _force(row: str, coefficient_set: CoefficientSet) -> list[str]:
    in_row = [c for c in coefficient_set if EQUATION_ROWS[c.row] == row]
    sums = [
        " + ".join(_term(c) for c in in_row if c.group == group) for group in dict.fromkeys(c.group for c in in_row)
    ]
    return [f"{row} = {_RIGID_BODY[row]}", *(f"{row} = {row} + {terms}" for terms in sums)]


def _term(coefficient: Coefficient) -> str:
    names = (FACTOR_INPUTS.get(signal, signal) for signal in coefficient.signals)
    factors = (f"abs({name})" if modulus else name for name, modulus in zip(names, coefficient.moduli, strict=True))
    return " * ".join([identifier(coefficient.symbol), *factors])


def matlab_text(model: IdentifiedModel, unsupported: UnsupportedFeatures, name: str) -> str:
    """Return the MATLAB function; `name` is that of the file without ``.m``."""
    signals = [f"{symbol} = motion({i})" for i, symbol in enumerate(MOTION_SYMBOLS, 1) if symbol != "psi"]
    inputs = inputs_of(model)
    signals += [f"{quantity.symbol} = inputs({i})" for i, quantity in enumerate(inputs, 1)]
    example = " ".join("100" if quantity.symbol == "surge_force" else "0" for quantity in inputs)
    help_text = _MATLAB_HELP.format(name=name, example=example, **_in_words(inputs))
    lines = [
        f"function derivative = {name}(motion, inputs)\n",
        line_comments("%", [*help_text.splitlines(), *_fin_signs(model), *heading_lines(model, unsupported)]),
        _matlab_constants(model),
        *(f"{statement};\n" for statement in [*signals, *_matlab_acceleration(model)]),
        "derivative = [acceleration; phi_rate; theta_rate; psi_rate];\n",
        "end\n",
    ]
    return "".join(lines)


def _in_words(inputs: Sequence[Quantity]) -> dict[str, str]:
    """Return names and units of inputs for help texts."""
    return {
        "inputs": " ".join(quantity.symbol for quantity in inputs),
        "units": ", ".join(quantity.unit.replace("*", " ") for quantity in inputs),
    }


def _matlab_constants(model: IdentifiedModel) -> str:
    """Return the mass matrix and all constants, a line each."""
    rows = "; ...\n".join("    " + " ".join(f"{number:.17g}" for number in row) for row in mass_rows(model))
    values = "".join(f"{c.name} = {c.value:.17g}; % {c.remark}\n" for c in constants(model))
    return f"\n% Rigid-body and added mass, kg, kg m, kg m^2.\nMASS = [ ...\n{rows}];\n{values}\n"


def _matlab_acceleration(model: IdentifiedModel) -> list[str]:
    """Return statements that compute ``acceleration`` and the attitude rates from motion and inputs."""
    momentum = [f"{axis} = momentum({i})" for i, axis in enumerate(("a1", "a2", "a3", "b1", "b2", "b3"), 1)]
    return [
        "momentum = MASS * [u; v; w; p; q; r]",
        *momentum,
        *statements(model.coefficient_set),
        "acceleration = MASS \\ [X; Y; Z; K; M; N]",
    ]


def python_text(model: IdentifiedModel, unsupported: UnsupportedFeatures, name: str) -> str:
    """Return the Python module."""
    rows = ",\n".join(f"        {row!r}" for row in mass_rows(model))
    deviations = [
        f"    {coefficient.symbol!r}: {coefficient.standard_deviation!r},\n"
        for coefficient in model.coefficients
        if coefficient.standard_deviation is not None
    ]
    inputs = inputs_of(model)
    lines = [
        # Without this line the name of a vehicle could declare another encoding.
        "# coding: utf-8\n",
        line_comments("#", [*heading_lines(model, unsupported), *_fin_signs(model)]),
        "\nfrom math import cos, sin\n\nimport numpy as np\n\n",
        f"# Rigid-body and added mass, kg, kg m, kg m^2.\nMASS = np.array(\n    [\n{rows},\n    ]\n)\n",
        *(f"{c.name} = {c.value!r}  # {c.remark}\n" for c in constants(model)),
        f"\nSTANDARD_DEVIATION = {{\n{''.join(deviations)}}}\n",
        f"NOT_IDENTIFIED = {model.not_identified()!r}\n",
        _FUNCTION.replace("INPUTS", str(len(inputs))).replace("MORE", FURTHER if len(inputs) > len(INPUTS) else ""),
        f"    {', '.join(MOTION_SYMBOLS)} = motion\n",
        f"    {', '.join(quantity.symbol for quantity in inputs)} = inputs\n",
        "    a1, a2, a3, b1, b2, b3 = MASS @ np.array([u, v, w, p, q, r])\n",
        *(f"    {statement}\n" for statement in statements(model.coefficient_set)),
        "    acceleration = np.linalg.solve(MASS, np.array([X, Y, Z, K, M, N]))\n",
        "    return np.array([*acceleration, phi_rate, theta_rate, psi_rate])\n",
    ]
    return "".join(lines)


def mss_text(model: IdentifiedModel, unsupported: UnsupportedFeatures, name: str) -> str:
    """Return the function of a vessel of MSS; `name` is that of the file without ``.m``."""
    inputs = inputs_of(model)
    help_text = _MSS_HELP.format(name=name, **_in_words(inputs))
    names = ", ".join(quantity.symbol.replace("_", " ") for quantity in inputs)
    places = {"p": 4, "q": 5, "r": 6, "phi": 10, "theta": 11, "psi": 12}
    body = [
        "if numel(x) ~= 12, error('x must have 12 elements'); end",
        f"if numel(ui) ~= {len(inputs)}, error('ui must have {len(inputs)} elements: {names}'); end",
        "if nargin < 4, Vc = 0; betaVc = 0; end",
        "if nargin < 5, w_c = 0; end",
        "x = x(:)",
        *(f"{symbol} = x({place})" for symbol, place in places.items()),
        *(f"{quantity.symbol} = ui({i})" for i, quantity in enumerate(inputs, 1)),
        *_ROTATION,
        "current = R' * [Vc*cos(betaVc); Vc*sin(betaVc); w_c]",
        "u = x(1) - current(1); v = x(2) - current(2); w = x(3) - current(3)",
        *_matlab_acceleration(model),
        "% In rotating axes the current rotates in the opposite direction.",
        "acceleration(1:3) = acceleration(1:3) - cross([p; q; r], current)",
        "xdot = [acceleration; R * x(1:3); phi_rate; theta_rate; psi_rate]",
        "U = norm(x(1:3))",
        "M = MASS",
    ]
    lines = [
        f"function [xdot, U, M] = {name}(x, ui, Vc, betaVc, w_c)\n",
        line_comments("%", [*help_text.splitlines(), *_fin_signs(model), *heading_lines(model, unsupported)]),
        _matlab_constants(model),
        *(statement + ("\n" if statement.startswith(("%", "if ")) else ";\n") for statement in body),
        "end\n",
    ]
    return "".join(lines)
