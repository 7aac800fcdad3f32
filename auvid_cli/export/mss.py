"""An identified model as a vessel of the Marine Systems Simulator, for MATLAB and Octave.

Arguments and results are those of its own torpedo, ``remus100``: state, inputs, and an ocean current that is the same
everywhere. Relative to such a current the equations of motion are those in still water (Fossen 2021, section 10.3).
"""

from auvid_cli.export.comment import line_comments
from auvid_cli.export.equations import inputs_of
from auvid_cli.export.heading import heading_lines
from auvid_cli.export.losses import Losses, losses_of
from auvid_cli.export.matlab_function import acceleration, in_words, numbers
from auvid_cli.export.model import IdentifiedModel

_HELP = """Compatible with MATLAB and GNU Octave, in the form of the vessels of MSS (remus100 and its like):
  [xdot, U, M] = {name}(x, ui, Vc, betaVc, w_c)   3-D ocean current
  [xdot, U, M] = {name}(x, ui, Vc, betaVc)        horizontal ocean current
  [xdot, U, M] = {name}(x, ui)                    no ocean current
  x = [u v w p q r x y z phi theta psi]', SI and radians: body axes forward, starboard, down; north, east, down.
  ui = [{inputs}]', {units}; as large as you like.
  Vc, betaVc, w_c: speed of the current, m/s, whereto, rad, and down, m/s.
  xdot: derivative of x; U: speed over ground, m/s; M: rigid-body and added mass.
For example: x = rk4(@{name}, 0.02, x, ui)
"""
_NOTES = (
    "Inputs are fin angles and the thrust in newtons, without limits and rates; MSS's thrust curves are not used.",
    "The state has Euler angles; quaternions are not taken.",
)
# Body axes to north, east, down, a column each.
_ROTATION = [
    "cphi = cos(phi); sphi = sin(phi); cth = cos(theta); sth = sin(theta); cpsi = cos(psi); spsi = sin(psi)",
    "R = [cpsi*cth, cpsi*sth*sphi - spsi*cphi, cpsi*sth*cphi + spsi*sphi; ...\n"
    "     spsi*cth, spsi*sth*sphi + cpsi*cphi, spsi*sth*cphi - cpsi*sphi; ...\n"
    "     -sth, cth*sphi, cth*cphi]",
]


def mss_losses(model: IdentifiedModel) -> Losses:
    """Name what lies outside the equations of motion, as in a bare function, and what MSS's own vessels have."""
    return losses_of(model, notes=_NOTES)


def mss_text(model: IdentifiedModel, losses: Losses, name: str) -> str:
    """Write the whole function; `name` is that of the file without ``.m``."""
    inputs = inputs_of(model)
    said = _HELP.format(name=name, **in_words(inputs))
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
        *acceleration(model),
        "% In turning axes the current turns the other way.",
        "acceleration(1:3) = acceleration(1:3) - cross([p; q; r], current)",
        "xdot = [acceleration; R * x(1:3); phi_rate; theta_rate; psi_rate]",
        "U = norm(x(1:3))",
        "M = MASS",
    ]
    lines = [
        f"function [xdot, U, M] = {name}(x, ui, Vc, betaVc, w_c)\n",
        line_comments("%", [*said.splitlines(), *heading_lines(model, losses)]),
        numbers(model),
        *(statement + ("\n" if statement.startswith(("%", "if ")) else ";\n") for statement in body),
        "end\n",
    ]
    return "".join(lines)
