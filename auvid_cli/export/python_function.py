"""An identified model as a Python module that needs only NumPy."""

from auvid_cli.export.comment import line_comments
from auvid_cli.export.equations import constants, inputs_of, mass_rows, statements
from auvid_cli.export.heading import heading_lines
from auvid_cli.export.losses import Losses
from auvid_cli.export.model import IdentifiedModel
from auvid_cli.vehicle.parameters import INPUTS, MOTION_SYMBOLS

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


def python_text(model: IdentifiedModel, losses: Losses, name: str) -> str:
    """Write the whole module."""
    rows = ",\n".join(f"        {row!r}" for row in mass_rows(model))
    deviations = [
        f"    {coefficient.symbol!r}: {coefficient.standard_deviation!r},\n"
        for coefficient in model.coefficients
        if coefficient.standard_deviation is not None
    ]
    inputs = inputs_of(model)
    lines = [
        # Else a vehicle's name could state an encoding, in which the module would be another one.
        "# coding: utf-8\n",
        line_comments("#", heading_lines(model, losses)),
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
