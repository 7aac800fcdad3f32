"""An identified model as an SDF model for Gazebo.

Element names and equations are those of gz-sim 8 (Harmonic). Its Hydrodynamics system reads the generic
derivatives ``<xUV>`` for ``X = c u v`` and ``<xUabsV>`` for ``X = c u |v|``. The added mass goes to the
``<fluid_added_mass>`` of SDFormat 1.10, into the inertia that the physics engine DART solves with and takes Coriolis
forces from. The system's own, ``<xDotU>``, differences velocities and blows up where added mass exceeds mass, and
its Coriolis forces lack the cross terms; so both are switched off. Fins are lift-drag surfaces, see
`auvid_cli.export.gazebo_fins`.
"""

from textwrap import indent
from typing import NamedTuple
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from auvid_cli.export.comment import xml_comment
from auvid_cli.export.gazebo_fins import add_fins, fin_area, fin_links
from auvid_cli.export.heading import certainty, heading_lines
from auvid_cli.export.losses import Losses, losses_of
from auvid_cli.export.model import IdentifiedModel
from auvid_cli.export.sdf_elements import add_inertial, as_text, child_of
from auvid_cli.printable import printable
from auvid_cli.vehicle.coefficients import EQUATION_ROWS, Coefficient

_LINK = "base_link"
_NOTES = (
    "Thrust and roll moment: give the model a Thruster system, or apply them with ApplyLinkWrench.",
    "In a current, DART takes the Coriolis forces of the added mass from the velocity over ground.",
)


def gazebo_losses(model: IdentifiedModel) -> Losses:
    """Name terms for which no system has a place, what changes, and an inertia that Gazebo would not accept."""
    in_fins = {symbol for fin in fin_links(model) for symbol in fin.surface.symbols}
    lost = [c.symbol for c in model.coefficient_set if not _has_element(c) and c.symbol not in in_fins]
    notes = (*_fin_notes(model), *_NOTES)
    smallest, middle, largest = np.linalg.eigvalsh(_hull(model).moments)
    physical = smallest > 0.0 and smallest + middle >= largest
    if physical:
        return losses_of(model, lost, notes)
    refused = (
        f"Gazebo refuses the inertia: no body has principal moments {smallest:.4g}, {middle:.4g}, {largest:.4g} kg m^2 "
        "about its centre of gravity."
    )
    return losses_of(model, lost, (*notes, refused))


def gazebo_text(model: IdentifiedModel, losses: Losses, name: str) -> str:
    """Write the whole file: a model of hull and fins; `name` is the model's."""
    size, parameters = model.experiment.vehicle.size, model.experiment.vehicle.known_parameters()
    gravity = parameters["W"] / parameters["m"]
    root = ElementTree.Element("sdf", version="1.10")
    body = child_of(root, "model", name=printable(name))
    link = child_of(body, "link", name=_LINK)
    _add_inertial(link, model)
    width = float(np.sqrt(parameters["B"] / (gravity * size.density * size.length)))
    for kind in ("collision", "visual"):
        part = child_of(link, kind, name=f"displaced_volume_{kind}")
        child_of(part, "pose", as_text(*_turned(parameters, "B"), 0.0, 0.0, 0.0))
        child_of(child_of(child_of(part, "geometry"), "box"), "size", as_text(size.length, width, width))
    system = child_of(body, "plugin", filename="gz-sim-hydrodynamics-system", name="gz::sim::systems::Hydrodynamics")
    child_of(system, "link_name", _LINK)
    child_of(system, "water_density", as_text(size.density))
    child_of(system, "default_current", "0 0 0")
    child_of(system, "disable_added_mass", "true")
    child_of(system, "disable_coriolis", "true")
    # Gazebo's axes are a half turn about x away, but none of the 22 changes its sign: where the force turns, so does
    # one signal, and else none or two. A term that no vehicle with a plane of symmetry has does.
    for coefficient, identified in zip(model.coefficient_set, model.coefficients, strict=True):
        if _has_element(coefficient):
            system.append(ElementTree.Comment(f" {xml_comment([f'{identified.symbol}: {certainty(identified)}'])} "))
            child_of(system, _element(coefficient), as_text(_sign_after_turn(coefficient) * identified.value))
    add_fins(body, _LINK, model)
    ElementTree.indent(root)
    heading = indent(xml_comment([*heading_lines(model, losses), *_advice(gravity, size.density)]), "  ")
    return f'<?xml version="1.0"?>\n<!--\n{heading}\n-->\n{ElementTree.tostring(root, encoding="unicode")}\n'


def _advice(gravity: float, density: float) -> list[str]:
    return [
        "Written for gz-sim 8 (Harmonic) with DART and SDFormat 1.10, by their sources; tested against their",
        "equations and in DART, not in a running Gazebo: look at a free drop and a straight run before you trust it.",
        "Axes are Gazebo's: x forward, y port, z up; v, w, q, r and Y, Z, M, N have the other sign than auvid's.",
        "Gazebo warns that terms such as <yUV> may be unstable: here they are the lift of the body, and belong.",
        "Fins: publish rad to /model/NAME/joint/rudder_joint/0/cmd_pos, and elevator_joint; signs are those of auvid.",
        "The collision box displaces the volume that gives the buoyancy. The world needs:",
        f"  <gravity>0 0 {-gravity:.12g}</gravity>",
        '  <plugin filename="gz-sim-buoyancy-system" name="gz::sim::systems::Buoyancy">',
        f"    <uniform_fluid_density>{density:.12g}</uniform_fluid_density>",
        "  </plugin>",
    ]


def _fin_notes(model: IdentifiedModel) -> list[str]:
    fins = fin_links(model)
    if not fins:
        return []
    units = {row: "N" if row in "XYZ" else "N*m" for row in model.surface_changes}
    changes = ", ".join(f"{row} by {rms:.3g} {units[row]}" for row, rms in model.surface_changes.items())
    places = " and ".join(f"that of the {fin.surface.name} at x = {fin.surface.place:.4g} m" for fin in fins)
    return [
        "Fins are lift-drag surfaces, whose force is across the flow at their centre of pressure instead of across the "
        f"hull; along the estimated motion that changes {changes} RMS. Astern it points the other way.",
        f"The centres of pressure are where force and moment meet, {places}; of area and slope only the product is "
        f"known, and the area here is {fin_area(model):.4g} m^2.",
    ]


class _Hull(NamedTuple):
    """What the link of the hull weighs: all but the fins, in Gazebo's axes."""

    mass: float
    centre: tuple[float, float, float]
    moments: NDArray[np.float64]


def _hull(model: IdentifiedModel) -> _Hull:
    """Take the fins from the vehicle; auvid's inertia is about the body's origin, Gazebo's about the centre."""
    parameters, fins = model.experiment.vehicle.known_parameters(), fin_links(model)
    mass = parameters["m"] - sum(fin.mass for fin in fins)
    moment = parameters["m"] * np.array(_turned(parameters, "G"))
    moment[0] -= sum(fin.mass * fin.place for fin in fins)
    centre = moment / mass
    about_origin = np.diag([parameters["Ixx"], parameters["Iyy"], parameters["Izz"]])
    for fin in fins:
        about_origin = about_origin - fin.inertia_about_origin
    moments = about_origin - mass * (centre @ centre * np.eye(3) - np.outer(centre, centre))
    x, y, z = centre.tolist()
    return _Hull(mass, (x, y, z), moments)


def _add_inertial(link: ElementTree.Element, model: IdentifiedModel) -> None:
    parameters = model.experiment.vehicle.known_parameters()
    added = child_of(add_inertial(link, *_hull(model)), "fluid_added_mass")
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
        child_of(added, element, as_text(-sum(parameters[symbol] for symbol in symbols) / len(symbols)))


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
