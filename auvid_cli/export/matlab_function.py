"""An identified model as a MATLAB function without toolboxes."""

from collections.abc import Sequence

from auvid_cli.export.comment import line_comments
from auvid_cli.export.equations import constants, inputs_of, mass_rows, statements
from auvid_cli.export.heading import heading_lines
from auvid_cli.export.losses import Losses
from auvid_cli.export.model import IdentifiedModel
from auvid_cli.vehicle.parameters import MOTION_SYMBOLS, Quantity

_HELP = """Time derivative of the motion [u v w p q r phi theta psi], SI and radians.
Body axes forward, starboard, down; angles to north, east, down.
inputs: [{inputs}], {units}.
For example: [t, x] = ode45(@(t, x) {name}(x, [{example}]), [0 10], [2 0 0 0 0 0 0 0 0]);
"""


def matlab_text(model: IdentifiedModel, losses: Losses, name: str) -> str:
    """Write the whole function; `name` is that of the file without ``.m``."""
    signals = [f"{symbol} = motion({i})" for i, symbol in enumerate(MOTION_SYMBOLS, 1) if symbol != "psi"]
    inputs = inputs_of(model)
    signals += [f"{quantity.symbol} = inputs({i})" for i, quantity in enumerate(inputs, 1)]
    example = " ".join("100" if quantity.symbol == "surge_force" else "0" for quantity in inputs)
    said = _HELP.format(name=name, example=example, **in_words(inputs))
    lines = [
        f"function derivative = {name}(motion, inputs)\n",
        line_comments("%", [*said.splitlines(), *heading_lines(model, losses)]),
        numbers(model),
        *(f"{statement};\n" for statement in [*signals, *acceleration(model)]),
        "derivative = [acceleration; phi_rate; theta_rate; psi_rate];\n",
        "end\n",
    ]
    return "".join(lines)


def in_words(inputs: Sequence[Quantity]) -> dict[str, str]:
    """Return the names and the units of inputs, for help texts."""
    return {
        "inputs": " ".join(quantity.symbol for quantity in inputs),
        "units": ", ".join(quantity.unit.replace("*", " ") for quantity in inputs),
    }


def numbers(model: IdentifiedModel) -> str:
    """Write the mass matrix and all constants, a line each, between empty ones."""
    rows = "; ...\n".join("    " + " ".join(f"{number:.17g}" for number in row) for row in mass_rows(model))
    values = "".join(f"{c.name} = {c.value:.17g}; % {c.remark}\n" for c in constants(model))
    return f"\n% Rigid-body and added mass, kg, kg m, kg m^2.\nMASS = [ ...\n{rows}];\n{values}\n"


def acceleration(model: IdentifiedModel) -> list[str]:
    """Write statements that make ``acceleration`` and the attitude rates of motion and inputs."""
    momentum = [f"{axis} = momentum({i})" for i, axis in enumerate(("a1", "a2", "a3", "b1", "b2", "b3"), 1)]
    return [
        "momentum = MASS * [u; v; w; p; q; r]",
        *momentum,
        *statements(model.coefficient_set),
        "acceleration = MASS \\ [X; Y; Z; K; M; N]",
    ]
