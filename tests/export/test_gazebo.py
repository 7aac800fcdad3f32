"""The written model against the compiled core, by the equations of gz-sim 8, of a rigid body, and by DART itself."""

import re
from xml.etree import ElementTree

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from auvid_cli.export.gazebo import gazebo_text, gazebo_unsupported
from auvid_cli.export.model import surface_changes
from auvid_cli.vehicle.rigid_body import rotation_matrix

HALF_TURN = np.diag([1.0, -1.0, -1.0])
OTHERS = ("X_udrdr", "K_T")
NAMES = ("rudder", "elevator")


@pytest.fixture(scope="module")
def plain(model_with):
    """The default vehicle, whose centres are on its axis."""
    return model_with()


def read(model):
    text = gazebo_text(model, gazebo_unsupported(model), "vehicle")
    return text, ElementTree.fromstring(text)


def skew(a):
    return np.array([[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]])


def vector(element, path):
    return np.array([float(number) for number in element.findtext(path).split()])


def plugin_force(root, velocity):
    """Force and moment by the Hydrodynamics system of gz-sim 8, without added mass and Coriolis forces."""
    plugin = root.find("model/plugin")
    damping = np.zeros((6, 6))
    for i, row in enumerate("xyzkmn"):
        for j, first in enumerate("UVWPQR"):
            damping[i, j] -= float(plugin.findtext(f"{row}{first}", "0"))
            for k, second in enumerate("UVWPQR"):
                damping[i, j] -= float(plugin.findtext(f"{row}{first}{second}", "0")) * velocity[k]
                damping[i, j] -= float(plugin.findtext(f"{row}{first}abs{second}", "0")) * abs(velocity[k])
    return -damping @ velocity


def mass_of(root):
    """Spatial inertia of hull, fins and water about the origin of the hull's link; mass and centre of gravity."""
    total, mass, moment = np.zeros((6, 6)), 0.0, np.zeros(3)
    for link in root.findall("model/link"):
        weight, centre, inertia = body_of(link)
        lever = skew(centre)
        total += np.block([[weight * np.eye(3), -weight * lever], [weight * lever, inertia - weight * lever @ lever]])
        mass, moment = mass + weight, moment + weight * centre
    total += added_mass_of(root)
    return total, mass, moment / mass


def body_of(link):
    """Mass, centre of gravity in the axes of the hull's link, and inertia about it."""
    inertial, inertia = link.find("inertial"), np.zeros((3, 3))
    place = np.zeros(3) if link.find("pose") is None else vector(link, "pose")[:3]
    for i, first in enumerate("xyz"):
        for j, second in enumerate("xyz"):
            inertia[i, j] = float(inertial.findtext("inertia/i" + "".join(sorted(first + second))))
    return float(inertial.findtext("mass")), place + vector(inertial, "pose")[:3], inertia


def added_mass_of(root):
    total, inertial = np.zeros((6, 6)), root.find("model/link/inertial")
    for i, first in enumerate("xyzpqr"):
        for j, second in enumerate("xyzpqr"):
            if i <= j:
                total[i, j] = total[j, i] = float(inertial.findtext(f"fluid_added_mass/{first}{second}", "0"))
    return total


def world_of(text):
    """Gravity and density that the heading asks the world for."""
    gravity = float(re.search(r"<gravity>0 0 (\S+)</gravity>", text).group(1))
    return -gravity, float(re.search(r"<uniform_fluid_density>(\S+)</uniform", text).group(1))


def surface_force(plugin, velocity, position):
    """Force and moment by the LiftDrag system of gz-sim 8, about the origin of the link, in the link's axes."""
    centre, forward, upward = (vector(plugin, tag) for tag in ("cp", "forward", "upward"))
    area, density = (float(plugin.findtext(tag)) for tag in ("area", "air_density"))
    # The angle of the flow itself causes neither lift nor drag.
    assert [float(plugin.findtext(tag)) for tag in ("cla", "cda", "a0")] == [0.0, 0.0, 0.0]
    there = velocity[:3] + np.cross(velocity[3:], centre)
    if np.linalg.norm(there) <= 0.01:
        return np.zeros(6)
    spanwise = np.cross(forward, upward)
    in_plane = there - there @ spanwise * spanwise
    lift_direction = np.cross(spanwise, in_plane) / np.linalg.norm(in_plane)
    lift_coefficient = float(plugin.findtext("control_joint_rad_to_cl")) * position
    force = lift_coefficient * 0.5 * density * in_plane @ in_plane * area * lift_direction
    return np.concatenate([force, np.cross(centre, force)])


def surfaces_of(root):
    return {
        plugin.findtext("control_joint_name"): plugin
        for plugin in root.findall("model/plugin")
        if plugin.get("name") == "gz::sim::systems::LiftDrag"
    }


def forces_but_weight(model, motion, inputs):
    """Force and moment of the systems, of the water and of the propeller, in the axes of the link; and what is up."""
    text, root = read(model)
    gravity, density = world_of(text)
    velocity = np.concatenate([HALF_TURN @ motion[:3], HALF_TURN @ motion[3:6]])
    phi, theta = motion[6:8]
    up = HALF_TURN @ -np.array([-np.sin(theta), np.cos(theta) * np.sin(phi), np.cos(theta) * np.cos(phi)])
    box = root.find("model/link/collision")
    lift = density * gravity * np.prod(vector(box, "geometry/box/size")) * up
    force = plugin_force(root, velocity)
    for joint, plugin in surfaces_of(root).items():
        force += surface_force(plugin, velocity, inputs[NAMES.index(joint.removesuffix("_joint"))])
    force[:3] += lift
    force[3:] += np.cross(vector(box, "pose")[:3], lift)
    force[[0, 3]] += inputs[2:]
    return force, up


def gazebo_acceleration(model, motion, inputs):
    """Acceleration of the link in its own axes, forward, port, up."""
    text, root = read(model)
    (gravity, _), (total, mass, centre) = world_of(text), mass_of(root)
    velocity = np.concatenate([HALF_TURN @ motion[:3], HALF_TURN @ motion[3:6]])
    force, up = forces_but_weight(model, motion, inputs)
    weight = -mass * gravity * up
    force += np.concatenate([weight, np.cross(centre, weight)])
    momentum, (linear, turning) = total @ velocity, (velocity[:3], velocity[3:])
    force[:3] -= np.cross(turning, momentum[:3])
    force[3:] -= np.cross(turning, momentum[3:]) + np.cross(linear, momentum[:3])
    return np.linalg.solve(total, force)


def assert_same(in_gazebo, model, motion, inputs, derivative_of):
    kept = [0.0 if each.symbol in OTHERS else each.value for each in model.coefficients]
    expected = derivative_of(model, motion, inputs, kept)[:6]
    turned = np.concatenate([HALF_TURN @ in_gazebo[:3], HALF_TURN @ in_gazebo[3:]])
    assert_allclose(turned, expected, rtol=1e-9, atol=1e-9 * np.abs(expected).max())


def assert_same_without_fins(model, motion, inputs, derivative_of):
    inputs[:2] = 0.0
    assert_same(gazebo_acceleration(model, motion, inputs), model, motion, inputs, derivative_of)


@pytest.mark.slow
@given(seed=st.integers(0, 2**32 - 1))
def test_gazebo_model_equals_the_core_with_fins_at_zero(seed, skewed, derivative_of, draw):
    assert_same_without_fins(skewed, *draw(seed), derivative_of)


def test_gazebo_models_of_shipped_vehicles_equal_the_core(vehicle_file, model_with, derivative_of, draw):
    assert_same_without_fins(model_with(vehicle_file=vehicle_file), *draw(5), derivative_of)


def fin_force(model, motion, inputs):
    """Force and moment of both surfaces, turned back to forward, starboard, down."""
    _, root = read(model)
    velocity = np.concatenate([HALF_TURN @ motion[:3], HALF_TURN @ motion[3:6]])
    surfaces = surfaces_of(root)
    total = sum(surface_force(surfaces[f"{name}_joint"], velocity, inputs[k]) for k, name in enumerate(NAMES))
    return np.concatenate([HALF_TURN @ total[:3], HALF_TURN @ total[3:]])


@given(speed=st.floats(0.1, 8.0), rudder=st.floats(-0.5, 0.5), elevator=st.floats(-0.5, 0.5))
@settings(max_examples=15)
def test_fin_forces_straight_ahead_equal_the_core(speed, rudder, elevator, plain, derivative_of):
    motion, inputs = np.array([speed, *np.zeros(8)]), np.array([rudder, elevator, 30.0, 1.0])
    assert_same(gazebo_acceleration(plain, motion, inputs), plain, motion, inputs, derivative_of)


@given(seed=st.integers(0, 2**32 - 1))
def test_fin_forces_in_a_drift_differ_in_second_order(seed, skewed):
    """With t the tangent of the flow's angle at the fin: sqrt(1 + t^2) times across the hull, and t times that back."""
    rng = np.random.default_rng(seed)
    motion, inputs = np.concatenate([[rng.uniform(1, 4)], rng.uniform(-0.4, 0.4, 8)]), rng.uniform(-0.4, 0.4, 4)
    value = {each.symbol: each.value for each in skewed.coefficients}
    (u, v, w, _, q, r), (rudder, elevator) = motion[:6], inputs[:2]
    tangents = (v + value["N_uudr"] / value["Y_uudr"] * r) / u, (w + value["M_uude"] / value["Z_uude"] * q) / u
    longer = [np.hypot(1.0, t) for t in tangents]
    across = value["Y_uudr"] * u * u * rudder * longer[0], value["Z_uude"] * u * u * elevator * longer[1]
    moments = value["M_uude"] * u * u * elevator * longer[1], value["N_uudr"] * u * u * rudder * longer[0]
    expected = [-np.dot(tangents, across), *across, 0.0, *moments]
    assert_allclose(fin_force(skewed, motion, inputs), expected, rtol=1e-9, atol=1e-9 * np.abs(expected).max())


def test_surface_changes_equal_those_of_the_system(skewed):
    rng = np.random.default_rng(3)
    motion, inputs = rng.uniform(-0.4, 0.4, (40, 9)), rng.uniform(-0.4, 0.4, (40, 4))
    motion[:, 0] += 2.0
    value = {each.symbol: each.value for each in skewed.coefficients}
    in_gazebo = np.array([fin_force(skewed, *each) for each in zip(motion, inputs, strict=True)])
    in_core = np.zeros((40, 6))
    for row, symbol, k in ((1, "Y_uudr", 0), (2, "Z_uude", 1), (4, "M_uude", 1), (5, "N_uudr", 0)):
        in_core[:, row] = value[symbol] * motion[:, 0] ** 2 * inputs[:, k]
    rms = np.sqrt(np.mean((in_gazebo - in_core) ** 2, axis=0))[[0, 1, 2, 4, 5]]
    assert surface_changes(value, motion, inputs) == pytest.approx(dict(zip("XYZMN", rms, strict=True)))


def test_dart_acceleration_equals_the_core(skewed, derivative_of, draw):
    """As gz-physics builds them: the added mass welded to the hull, without a weight, and a joint for each fin."""
    dart = pytest.importorskip("dartpy")
    text, root = read(skewed)
    hull, *fins = root.findall("model/link")
    skeleton = dart.dynamics.Skeleton("model")
    free, body = skeleton.createFreeJointAndBodyNodePair()
    body.setInertia(dart.dynamics.Inertia(*body_of(hull)))
    for fin in fins:
        mass, place, inertia = body_of(fin)
        joint, node = skeleton.createRevoluteJointAndBodyNodePair(body)
        joint.setAxis(vector(root.find(f"model/joint[child='{fin.get('name')}']"), "axis/xyz"))
        there = dart.math.Isometry3()
        there.set_translation(place)
        joint.setTransformFromParentBodyNode(there)
        node.setInertia(dart.dynamics.Inertia(mass, np.zeros(3), inertia))
        # Where the controller holds it.
        joint.setActuatorType(dart.dynamics.ActuatorType.LOCKED)
    _, water = skeleton.createWeldJointAndBodyNodePair(body)
    # DART states what turns first.
    turned = np.roll(np.arange(6), 3)
    water.setInertia(dart.dynamics.Inertia(np.asfortranarray(added_mass_of(root)[np.ix_(turned, turned)])))
    water.setGravityMode(False)
    skeleton.setGravity([0.0, 0.0, -world_of(text)[0]])
    for seed in range(5):
        motion, inputs = draw(seed)
        inputs[:2] = 0.0
        pose = dart.math.Isometry3()
        pose.set_rotation(HALF_TURN @ rotation_matrix(motion[6:]) @ HALF_TURN)
        free.setTransform(pose)
        velocity = np.concatenate([HALF_TURN @ motion[3:6], HALF_TURN @ motion[:3]])
        free.setSpatialVelocity(velocity, dart.dynamics.Frame.World(), body)
        force, _ = forces_but_weight(skewed, motion, inputs)
        body.setExtForce(force[:3], np.zeros(3), True, True)
        body.setExtTorque(force[3:], True)
        skeleton.computeForwardDynamics()
        found = body.getSpatialAcceleration()
        assert_same(np.concatenate([found[3:], found[:3]]), skewed, motion, inputs, derivative_of)


def test_fin_without_force_is_lost(model_with):
    model = model_with("vehicle.coefficients.Y_uudr=0")
    unsupported, (_, root) = gazebo_unsupported(model), read(model)
    assert [term.symbol for term in unsupported.terms] == ["Y_uudr", "N_uudr"]
    assert [*surfaces_of(root)] == ["elevator_joint"]
    assert "elevator at x" in " ".join(unsupported.notes)
    assert "rudder at x" not in " ".join(unsupported.notes)


def test_losses_have_their_sizes(skewed):
    unsupported = gazebo_unsupported(skewed)
    assert tuple(term.symbol for term in unsupported.terms) == OTHERS
    assert all(term in skewed.term_sizes for term in unsupported.terms)
    text, _ = read(skewed)
    for term in unsupported.terms:
        assert f"{term.symbol} in {term.row}: {term.rms:.3g} {term.unit}, {term.percent:.3g} %" in text


def test_other_coefficients_have_standard_deviations(model_with):
    text, root = read(model_with(held=("X_u|u|",), not_identified=("N_v|v|",)))
    numbers = [child.tag for child in root.find("model/plugin") if re.fullmatch("[xyzkmn][A-Z](abs)?[A-Z]", child.tag)]
    assert len(numbers) == 18
    assert re.search(r"<!-- X_u\|u\|: held, not estimated -->\s*<xUabsU>", text)
    assert re.search(r"<!-- N_v\|v\|: standard deviation \S+; identified: false -->\s*<nVabsV>", text)


def test_impossible_inertia_is_noted(model_with):
    heavy_below = model_with("vehicle.parameters.zG=0.2")
    assert "Gazebo refuses the inertia" in " ".join(gazebo_unsupported(heavy_below).notes)
    assert "Gazebo refuses the inertia" not in " ".join(gazebo_unsupported(model_with()).notes)


@pytest.mark.parametrize("name", ["one--two", "one -->", "<b> & ---"])
def test_any_vehicle_name_gives_valid_xml(name, model_with):
    _, root = read(model_with(f"vehicle.name={name}"))
    assert root.find("model").get("name") == "vehicle"
