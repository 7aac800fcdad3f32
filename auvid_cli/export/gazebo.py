"""Vehicle for Gazebo: an SDF model with the hydrodynamics plugin and fins."""

from textwrap import indent
from typing import NamedTuple
from xml.etree import ElementTree

import numpy as np

from auvid_cli.arrays import Array
from auvid_cli.export.model import FinSurface, IdentifiedModel, fin_surfaces
from auvid_cli.export.unsupported_features import (
    UnsupportedFeatures,
    certainty,
    heading_lines,
    unsupported_features,
    xml_comment,
)
from auvid_cli.text import printable
from auvid_cli.vehicle.coefficients import EQUATION_ROWS, Coefficient

# Mass of a fin as a share of that of the vehicle; Gazebo needs a mass for every link.
_FIN_MASS = 1e-3
# The inertia of a fin is that of a ball, which does not change with its angle.
_RADIUS_OF_GYRATION = 0.05  # m
# Distance of the fins behind the centre of buoyancy, as a share of the length.
_FIN_DISTANCE = 0.45
_LINK = "base_link"
_NOTES = (
    "Thrust and roll moment: give the model a Thruster system, or apply them with ApplyLinkWrench.",
    "In a current, DART takes the Coriolis forces of the added mass from the velocity over ground.",
)


def child_of(parent: ElementTree.Element, tag: str, text: str | None = None, **attributes: str) -> ElementTree.Element:
    """Append an element to another and return it."""
    child = ElementTree.SubElement(parent, tag, attributes)
    child.text = text
    return child


def as_text(*values: float) -> str:
    """Write numbers, separated by spaces."""
    # Adding zero turns -0.0 into 0.0.
    return " ".join(repr(float(value) + 0.0) for value in values)


def add_inertial(
    link: ElementTree.Element, mass: float, centre: tuple[float, float, float], moments: Array
) -> ElementTree.Element:
    """Append mass, kg, centre of gravity, m, and the inertia about it, kg m^2, shape (3, 3), to a link."""
    inertial = child_of(link, "inertial")
    child_of(inertial, "mass", as_text(mass))
    child_of(inertial, "pose", as_text(*centre, 0.0, 0.0, 0.0))
    inertia = child_of(inertial, "inertia")
    for row, column in ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)):
        child_of(inertia, f"i{'xyz'[row]}{'xyz'[column]}", as_text(moments[row, column]))
    return inertial


class FinLink(NamedTuple):
    """A fin as a body with a mass, kg, drawn at `place`, m forward of the origin."""

    surface: FinSurface
    mass: float
    place: float

    @property
    def inertia(self) -> Array:
        """Return the inertia about its centre, kg m^2."""
        return self.mass * _RADIUS_OF_GYRATION**2 * np.eye(3)

    @property
    def inertia_about_origin(self) -> Array:
        """Return the inertia about the origin of the vehicle, kg m^2."""
        return self.inertia + self.mass * self.place**2 * np.diag([0.0, 1.0, 1.0])


def fin_links(model: IdentifiedModel) -> list[FinLink]:
    """Return the fins of a model as bodies."""
    vehicle = model.experiment.vehicle
    parameters = vehicle.known_parameters()
    place = parameters["xB"] - _FIN_DISTANCE * vehicle.size.length
    surfaces = fin_surfaces({each.symbol: each.value for each in model.coefficients})
    return [FinLink(surface, _FIN_MASS * parameters["m"], place) for surface in surfaces]


def fin_area(model: IdentifiedModel) -> float:
    """Return the area of two fins, m^2, or 1 if unknown: only its product with the lift slope matters."""
    geometry = model.experiment.vehicle.geometry
    return 1.0 if geometry is None else 2.0 * geometry.fins.area


def add_fins(body: ElementTree.Element, hull: str, model: IdentifiedModel) -> None:
    """Append links, joints and systems of all fins to a model with a link named `hull`."""
    size, area = model.experiment.vehicle.size, fin_area(model)
    side = float(np.sqrt(area / 2.0)) if area < size.length**2 else size.diameter
    for fin in fin_links(model):
        name, is_rudder = fin.surface.name, fin.surface.name == "rudder"
        link = child_of(body, "link", name=name)
        child_of(link, "pose", as_text(fin.place, 0.0, 0.0, 0.0, 0.0, 0.0), relative_to=hull)
        add_inertial(link, fin.mass, (0.0, 0.0, 0.0), fin.inertia)
        box = child_of(child_of(child_of(link, "visual", name=f"{name}_visual"), "geometry"), "box")
        span = size.diameter + 2.0 * side
        child_of(box, "size", as_text(side, *((0.01, span) if is_rudder else (span, 0.01))))
        joint = child_of(body, "joint", name=f"{name}_joint", type="revolute")
        child_of(joint, "parent", hull)
        child_of(joint, "child", name)
        # The leading edge turns to the side of the force.
        side_of_force = float(np.sign(fin.surface.force))
        axis = (0.0, -side_of_force) if is_rudder else (side_of_force, 0.0)
        child_of(child_of(joint, "axis"), "xyz", as_text(0.0, *axis))
        _add_lift(body, hull, fin.surface, model, area)
        controller = child_of(
            body,
            "plugin",
            filename="gz-sim-joint-position-controller-system",
            name="gz::sim::systems::JointPositionController",
        )
        child_of(controller, "joint_name", f"{name}_joint")
        child_of(controller, "use_velocity_commands", "true")


def _add_lift(body: ElementTree.Element, hull: str, surface: FinSurface, model: IdentifiedModel, area: float) -> None:
    density = model.experiment.vehicle.size.density
    system = child_of(body, "plugin", filename="gz-sim-lift-drag-system", name="gz::sim::systems::LiftDrag")
    child_of(system, "link_name", hull)
    child_of(system, "control_joint_name", f"{surface.name}_joint")
    # Axes of Gazebo are to port and up, so that a force to starboard or down is negative.
    child_of(system, "control_joint_rad_to_cl", as_text(-2.0 * surface.force / (density * area)))
    child_of(system, "area", as_text(area))
    child_of(system, "air_density", as_text(density))
    child_of(system, "cp", as_text(surface.place, 0.0, 0.0))
    child_of(system, "forward", "1 0 0")
    child_of(system, "upward", "0 1 0" if surface.name == "rudder" else "0 0 1")
    for coefficient in ("cla", "cda", "cma", "a0"):
        child_of(system, coefficient, "0")


def gazebo_unsupported(model: IdentifiedModel) -> UnsupportedFeatures:
    """Return terms without an element, effects of the fin surfaces, and an inertia that Gazebo would refuse."""
    fin_symbols = {symbol for fin in fin_links(model) for symbol in fin.surface.symbols}
    lost = [c.symbol for c in model.coefficient_set if not _has_element(c) and c.symbol not in fin_symbols]
    notes = (*_fin_notes(model), *_NOTES)
    smallest, middle, largest = np.linalg.eigvalsh(_hull(model).moments)
    if not (smallest > 0.0 and smallest + middle >= largest):
        moments = f"{smallest:.4g}, {middle:.4g}, {largest:.4g}"
        refused = f"Gazebo refuses the inertia: impossible principal moments {moments} kg m^2 of the hull."
        notes = (*notes, refused)
    return unsupported_features(model, lost, notes)


def gazebo_text(model: IdentifiedModel, unsupported: UnsupportedFeatures, name: str) -> str:
    """Return the file of a model with hull and fins."""
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
    # The half turn about x to the axes of Gazebo changes no sign of the 22 coefficients: force and signals change sign
    # together. Terms of a vehicle without a plane of symmetry may change sign.
    for coefficient, identified in zip(model.coefficient_set, model.coefficients, strict=True):
        if _has_element(coefficient):
            system.append(ElementTree.Comment(f" {xml_comment([f'{identified.symbol}: {certainty(identified)}'])} "))
            child_of(system, _element(coefficient), as_text(_sign_after_turn(coefficient) * identified.value))
    add_fins(body, _LINK, model)
    ElementTree.indent(root)
    heading = indent(xml_comment([*heading_lines(model, unsupported), *_advice(gravity, size.density)]), "  ")
    return f'<?xml version="1.0"?>\n<!--\n{heading}\n-->\n{ElementTree.tostring(root, encoding="unicode")}\n'


def _advice(gravity: float, density: float) -> list[str]:
    return [
        "Written for gz-sim 8 (Harmonic) with DART and SDFormat 1.10, by their sources; tested against their",
        "equations and in DART, not in a running Gazebo: look at a free drop and a straight run before you trust it.",
        "Axes are Gazebo's: x forward, y port, z up; v, w, q, r and Y, Z, M, N have the other sign than auvid's.",
        "Gazebo warns that terms such as <yUV> may be unstable: here they are the lift of the body, and are correct.",
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
    """Mass, centre of gravity and inertia about it of the hull without fins, in axes of Gazebo."""

    mass: float
    centre: tuple[float, float, float]
    moments: Array


def _hull(model: IdentifiedModel) -> _Hull:
    """Return the hull: inertia is about the origin in auvid, and about the centre of gravity in Gazebo."""
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
    # The half turn does not change these: it changes the signs of y and r, and of z and q, together.
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
    """Whether it has the form ``<xU>``, ``<xUV>`` or ``<xUabsV>``, which Hydrodynamics reads."""
    depends_on_velocity = {*coefficient.signals} <= {*"uvwpqr"}
    n_factors = len(coefficient.factors)
    return depends_on_velocity and n_factors <= 2 and sum(coefficient.moduli) < n_factors


def _sign_after_turn(coefficient: Coefficient) -> float:
    bare = (s for s, modulus in zip(coefficient.signals, coefficient.moduli, strict=True) if not modulus)
    turns = (EQUATION_ROWS[coefficient.row] in "YZMN") + sum(signal in "vwqr" for signal in bare)
    return -1.0 if turns % 2 else 1.0


def _element(coefficient: Coefficient) -> str:
    """Return the name of the element, for example ``yUV``, or ``yRabsR`` with a magnitude."""
    factors = sorted(zip(coefficient.moduli, coefficient.signals, strict=True), key=lambda factor: factor[0])
    return EQUATION_ROWS[coefficient.row].lower() + "".join(
        "abs" * modulus + signal.upper() for modulus, signal in factors
    )
