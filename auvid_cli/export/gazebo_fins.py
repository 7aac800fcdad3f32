"""Rudder and elevator in a Gazebo model: a joint for each, and a LiftDrag system that its position works.

LiftDrag of gz-sim 8 adds ``control_joint_rad_to_cl`` times the joint's position to the coefficient of lift of the
hull's link at the centre of pressure. The lift that the fins have from the flow's own angle stands in the hull's
coefficients already, so that the surface has none of its own.
"""

from typing import NamedTuple
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from auvid_cli.export.fin_surfaces import FinSurface, fin_surfaces
from auvid_cli.export.model import IdentifiedModel
from auvid_cli.export.sdf_elements import add_inertial, as_text, child_of

Array = NDArray[np.float64]

# Of the vehicle's mass, taken from its hull; a link without mass is none.
_SHARE_OF_MASS = 1e-3
# m; of a ball, which is the same however it is turned.
_RADIUS_OF_GYRATION = 0.05
# Where they are drawn, of the length behind the centre of buoyancy.
_BEHIND = 0.45


class FinLink(NamedTuple):
    """A fin as a body.

    Attributes
    ----------
    surface : FinSurface
    mass : float
        kg.
    place : float
        Forward of the origin, m, where it is drawn.
    """

    surface: FinSurface
    mass: float
    place: float

    @property
    def inertia(self) -> Array:
        """Return that about its centre, kg m^2."""
        return self.mass * _RADIUS_OF_GYRATION**2 * np.eye(3)

    @property
    def inertia_about_origin(self) -> Array:
        """Return that about the origin of the vehicle, kg m^2."""
        return self.inertia + self.mass * self.place**2 * np.diag([0.0, 1.0, 1.0])


def fin_links(model: IdentifiedModel) -> list[FinLink]:
    """Return the fins of a model as bodies."""
    vehicle = model.experiment.vehicle
    parameters = vehicle.known_parameters()
    place = parameters["xB"] - _BEHIND * vehicle.size.length
    surfaces = fin_surfaces({each.symbol: each.value for each in model.coefficients})
    return [FinLink(surface, _SHARE_OF_MASS * parameters["m"], place) for surface in surfaces]


def fin_area(model: IdentifiedModel) -> float:
    """Return the area of two fins of the drawing, m^2, or 1 where there is none: only its product with a slope acts."""
    geometry = model.experiment.vehicle.geometry
    return 1.0 if geometry is None else 2.0 * geometry.fins.area


def add_fins(body: ElementTree.Element, hull: str, model: IdentifiedModel) -> None:
    """Append links, joints and systems of all fins to a model, the link of whose hull has that name."""
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
        # Its leading edge goes to where the force does.
        push = float(np.sign(fin.surface.force))
        child_of(child_of(joint, "axis"), "xyz", as_text(0.0, *((0.0, -push) if is_rudder else (push, 0.0))))
        _add_lift(body, hull, fin.surface, model, area)
        driven = child_of(
            body,
            "plugin",
            filename="gz-sim-joint-position-controller-system",
            name="gz::sim::systems::JointPositionController",
        )
        child_of(driven, "joint_name", f"{name}_joint")
        child_of(driven, "use_velocity_commands", "true")


def _add_lift(body: ElementTree.Element, hull: str, surface: FinSurface, model: IdentifiedModel, area: float) -> None:
    density = model.experiment.vehicle.size.density
    system = child_of(body, "plugin", filename="gz-sim-lift-drag-system", name="gz::sim::systems::LiftDrag")
    child_of(system, "link_name", hull)
    child_of(system, "control_joint_name", f"{surface.name}_joint")
    # Gazebo's axes are to port and up, so that a force to starboard or down is negative.
    child_of(system, "control_joint_rad_to_cl", as_text(-2.0 * surface.force / (density * area)))
    child_of(system, "area", as_text(area))
    child_of(system, "air_density", as_text(density))
    child_of(system, "cp", as_text(surface.place, 0.0, 0.0))
    child_of(system, "forward", "1 0 0")
    child_of(system, "upward", "0 1 0" if surface.name == "rudder" else "0 0 1")
    for coefficient in ("cla", "cda", "cma", "a0"):
        child_of(system, coefficient, "0")
