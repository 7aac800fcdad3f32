"""An identified model as an SDF model for Gazebo.

Element names and equations are those of gz-sim 8 (Harmonic). Its Hydrodynamics system reads the generic
derivatives ``<xUV>`` for ``X = c u v`` and ``<xUabsV>`` for ``X = c u |v|``. The added mass goes to the
``<fluid_added_mass>`` of SDFormat 1.10, into the inertia that the physics engine DART solves with and takes Coriolis
forces from. The system's own, ``<xDotU>``, differences velocities and blows up where added mass exceeds mass, and
its Coriolis forces lack the cross terms; so both are switched off.
"""

from textwrap import indent
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from auvid_cli.export.comment import xml_comment
from auvid_cli.export.heading import certainty, heading_lines
from auvid_cli.export.losses import Losses, losses_of
from auvid_cli.export.model import IdentifiedModel
from auvid_cli.printable import printable
from auvid_cli.vehicle.coefficients import EQUATION_ROWS, Coefficient

_LINK = "base_link"
_NOTES = (
    "Fins: give them joints and LiftDrag systems, or apply their forces from outside.",
    "Thrust and roll moment: give the model a Thruster system, or apply them with ApplyLinkWrench.",
    "In a current, DART takes the Coriolis forces of the added mass from the velocity over ground.",
)


def gazebo_losses(model: IdentifiedModel) -> Losses:
    """Name terms for which Hydrodynamics has no place, as of fins, and an inertia that Gazebo would not accept."""
    lost = [c.symbol for c in model.coefficient_set if not _has_element(c)]
    smallest, middle, largest = np.linalg.eigvalsh(_central_inertia(model.experiment.vehicle.known_parameters()))
    physical = smallest > 0.0 and smallest + middle >= largest
    if physical:
        return losses_of(model, lost, _NOTES)
    refused = (
        f"Gazebo refuses the inertia: no body has principal moments {smallest:.4g}, {middle:.4g}, {largest:.4g} kg m^2 "
        "about its centre of gravity."
    )
    return losses_of(model, lost, (*_NOTES, refused))


def gazebo_text(model: IdentifiedModel, losses: Losses, name: str) -> str:
    """Write the whole file: one model of one link; `name` is the model's."""
    size, parameters = model.experiment.vehicle.size, model.experiment.vehicle.known_parameters()
    gravity = parameters["W"] / parameters["m"]
    root = ElementTree.Element("sdf", version="1.10")
    body = _child(root, "model", name=printable(name))
    link = _child(body, "link", name=_LINK)
    _add_inertial(link, parameters)
    width = float(np.sqrt(parameters["B"] / (gravity * size.density * size.length)))
    for kind in ("collision", "visual"):
        part = _child(link, kind, name=f"displaced_volume_{kind}")
        _child(part, "pose", _numbers(*_turned(parameters, "B"), 0.0, 0.0, 0.0))
        _child(_child(_child(part, "geometry"), "box"), "size", _numbers(size.length, width, width))
    system = _child(body, "plugin", filename="gz-sim-hydrodynamics-system", name="gz::sim::systems::Hydrodynamics")
    _child(system, "link_name", _LINK)
    _child(system, "water_density", _numbers(size.density))
    _child(system, "default_current", "0 0 0")
    _child(system, "disable_added_mass", "true")
    _child(system, "disable_coriolis", "true")
    # Gazebo's axes are a half turn about x away, but none of the 22 changes its sign: where the force turns, so does
    # one signal, and else none or two. A term that no vehicle with a plane of symmetry has does.
    for coefficient, identified in zip(model.coefficient_set, model.coefficients, strict=True):
        if _has_element(coefficient):
            system.append(ElementTree.Comment(f" {xml_comment([f'{identified.symbol}: {certainty(identified)}'])} "))
            _child(system, _element(coefficient), _numbers(_sign_after_turn(coefficient) * identified.value))
    ElementTree.indent(root)
    heading = indent(xml_comment([*heading_lines(model, losses), *_advice(gravity, size.density)]), "  ")
    return f'<?xml version="1.0"?>\n<!--\n{heading}\n-->\n{ElementTree.tostring(root, encoding="unicode")}\n'


def _advice(gravity: float, density: float) -> list[str]:
    return [
        "Written for gz-sim 8 (Harmonic) with DART and SDFormat 1.10, by their sources; tested against their",
        "equations, not in a running Gazebo: look at a free drop and a straight run before you trust it.",
        "Axes are Gazebo's: x forward, y port, z up; v, w, q, r and Y, Z, M, N have the other sign than auvid's.",
        "Gazebo warns that terms such as <yUV> may be unstable: here they are the lift of the body, and belong.",
        "The collision box displaces the volume that gives the buoyancy. The world needs:",
        f"  <gravity>0 0 {-gravity:.12g}</gravity>",
        '  <plugin filename="gz-sim-buoyancy-system" name="gz::sim::systems::Buoyancy">',
        f"    <uniform_fluid_density>{density:.12g}</uniform_fluid_density>",
        "  </plugin>",
    ]


def _add_inertial(link: ElementTree.Element, parameters: dict[str, float]) -> None:
    inertial = _child(link, "inertial")
    _child(inertial, "mass", _numbers(parameters["m"]))
    _child(inertial, "pose", _numbers(*_turned(parameters, "G"), 0.0, 0.0, 0.0))
    inertia, moments = _child(inertial, "inertia"), _central_inertia(parameters)
    for row, column in ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)):
        _child(inertia, f"i{'xyz'[row]}{'xyz'[column]}", _numbers(moments[row, column]))
    added = _child(inertial, "fluid_added_mass")
    # The half turn leaves all of these as they are: it changes the signs of y and r, and of z and q, together.
    for element, symbols in (
        ("xx", ("X_udot",)),
        ("yy", ("Y_vdot",)),
        ("yr", ("Y_rdot", "N_vdot")),
        ("zz", ("Z_wdot",)),
        ("zq", ("Z_qdot", "M_wdot")),
        ("pp", ("K_pdot",)),
        ("qq", ("M_qdot",)),
        ("rr", ("N_rdot",)),
    ):
        _child(added, element, _numbers(-sum(parameters[symbol] for symbol in symbols) / len(symbols)))


def _central_inertia(parameters: dict[str, float]) -> NDArray[np.float64]:
    """Return the inertia about the centre of gravity in Gazebo's axes; auvid's is about the body's origin."""
    lever = np.array(_turned(parameters, "G"))
    about_origin = np.diag([parameters["Ixx"], parameters["Iyy"], parameters["Izz"]])
    return about_origin - parameters["m"] * (lever @ lever * np.eye(3) - np.outer(lever, lever))


def _turned(parameters: dict[str, float], centre: str) -> tuple[float, float, float]:
    return parameters[f"x{centre}"], -parameters[f"y{centre}"], -parameters[f"z{centre}"]


def _has_element(coefficient: Coefficient) -> bool:
    """Say whether it is a ``<xU>``, ``<xUV>`` or ``<xUabsV>``, which Hydrodynamics reads."""
    moving = {*coefficient.signals} <= {*"uvwpqr"}
    return moving and len(coefficient.factors) <= 2 and sum(coefficient.moduli) < len(coefficient.factors)


def _sign_after_turn(coefficient: Coefficient) -> float:
    bare = (s for s, modulus in zip(coefficient.signals, coefficient.moduli, strict=True) if not modulus)
    turns = (EQUATION_ROWS[coefficient.row] in "YZMN") + sum(signal in "vwqr" for signal in bare)
    return -1.0 if turns % 2 else 1.0


def _element(coefficient: Coefficient) -> str:
    """Name the element, for example ``yUV``, or ``yRabsR`` where a magnitude enters."""
    factors = sorted(zip(coefficient.moduli, coefficient.signals, strict=True), key=lambda factor: factor[0])
    return EQUATION_ROWS[coefficient.row].lower() + "".join(
        "abs" * modulus + signal.upper() for modulus, signal in factors
    )


def _child(parent: ElementTree.Element, tag: str, text: str | None = None, **attributes: str) -> ElementTree.Element:
    child = ElementTree.SubElement(parent, tag, attributes)
    child.text = text
    return child


def _numbers(*values: float) -> str:
    # Adding zero takes the sign off a zero.
    return " ".join(repr(float(value) + 0.0) for value in values)
