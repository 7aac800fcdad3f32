"""The written model against the compiled core, by the equations of gz-sim 8 and of a rigid body in Gazebo's axes."""

import re
from xml.etree import ElementTree

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from auvid_cli.export.gazebo import gazebo_losses, gazebo_text

HALF_TURN = np.diag([1.0, -1.0, -1.0])
FINS = ("Y_uudr", "Z_uude", "M_uude", "N_uudr")
OTHERS = ("X_udrdr", "K_T")


def read(model):
    text = gazebo_text(model, gazebo_losses(model), "vehicle")
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
    """Spatial inertia about the origin of the link: the body's own and the water's."""
    inertial = root.find("model/link/inertial")
    mass, centre = float(inertial.findtext("mass")), vector(inertial, "pose")[:3]
    inertia = np.zeros((3, 3))
    for i, first in enumerate("xyz"):
        for j, second in enumerate("xyz"):
            inertia[i, j] = float(inertial.findtext("inertia/i" + "".join(sorted(first + second))))
    lever = skew(centre)
    total = np.block([[mass * np.eye(3), -mass * lever], [mass * lever, inertia - mass * lever @ lever]])
    for i, first in enumerate("xyzpqr"):
        for j, second in enumerate("xyzpqr"):
            if i <= j:
                added = float(inertial.findtext(f"fluid_added_mass/{first}{second}", "0"))
                total[i, j] += added
                total[j, i] += added if i != j else 0.0
    return total, mass, centre


def world_of(text):
    """Gravity and density that the heading asks the world for."""
    gravity = float(re.search(r"<gravity>0 0 (\S+)</gravity>", text).group(1))
    return -gravity, float(re.search(r"<uniform_fluid_density>(\S+)</uniform", text).group(1))


def gazebo_acceleration(model, motion, inputs):
    """Acceleration of the link in its own axes, forward, port, up."""
    text, root = read(model)
    (gravity, density), (total, mass, centre) = world_of(text), mass_of(root)
    velocity = np.concatenate([HALF_TURN @ motion[:3], HALF_TURN @ motion[3:6]])
    phi, theta = motion[6:8]
    up = HALF_TURN @ -np.array([-np.sin(theta), np.cos(theta) * np.sin(phi), np.cos(theta) * np.cos(phi)])
    box = root.find("model/link/collision")
    lift = density * gravity * np.prod(vector(box, "geometry/box/size")) * up
    weight, centre_of_volume = -mass * gravity * up, vector(box, "pose")[:3]
    force = plugin_force(root, velocity)
    force[:3] += weight + lift + [inputs[2], 0.0, 0.0]
    force[3:] += np.cross(centre, weight) + np.cross(centre_of_volume, lift) + [inputs[3], 0.0, 0.0]
    momentum, (linear, turning) = total @ velocity, (velocity[:3], velocity[3:])
    force[:3] -= np.cross(turning, momentum[:3])
    force[3:] -= np.cross(turning, momentum[3:]) + np.cross(linear, momentum[:3])
    return np.linalg.solve(total, force)


def assert_same_without_fins(model, motion, inputs, derivative_of):
    inputs[:2] = 0.0
    kept = [0.0 if each.symbol in OTHERS else each.value for each in model.coefficients]
    expected = derivative_of(model, motion, inputs, kept)[:6]
    in_gazebo = gazebo_acceleration(model, motion, inputs)
    turned = np.concatenate([HALF_TURN @ in_gazebo[:3], HALF_TURN @ in_gazebo[3:]])
    assert_allclose(turned, expected, rtol=1e-9, atol=1e-9 * np.abs(expected).max())


@given(seed=st.integers(0, 2**32 - 1))
def test_gazebo_accelerates_as_the_core_with_fins_amidships(seed, skewed, derivative_of, draw):
    assert_same_without_fins(skewed, *draw(seed), derivative_of)


def test_so_does_every_shipped_vehicle(vehicle_file, model_with, derivative_of, draw):
    assert_same_without_fins(model_with(vehicle_file=vehicle_file), *draw(5), derivative_of)


def test_what_is_lost_is_the_fins_and_other_products_with_their_size(skewed):
    losses = gazebo_losses(skewed)
    assert tuple(term.symbol for term in losses.terms) == FINS + OTHERS
    assert all(term in skewed.term_sizes for term in losses.terms)
    text, _ = read(skewed)
    for term in losses.terms:
        assert f"{term.symbol} in {term.row}: {term.rms:.3g} {term.unit}, {term.percent:.3g} %" in text


def test_every_other_coefficient_is_there_with_its_standard_deviation(model_with):
    text, root = read(model_with(held=("X_u|u|",), not_identified=("N_v|v|",)))
    numbers = [child.tag for child in root.find("model/plugin") if re.fullmatch("[xyzkmn][A-Z](abs)?[A-Z]", child.tag)]
    assert len(numbers) == 18
    assert re.search(r"<!-- X_u\|u\|: held, not estimated -->\s*<xUabsU>", text)
    assert re.search(r"<!-- N_v\|v\|: standard deviation \S+; identified: false -->\s*<nVabsV>", text)


def test_an_impossible_inertia_is_told_of(model_with):
    heavy_below = model_with("vehicle.parameters.zG=0.2")
    assert "Gazebo refuses the inertia" in " ".join(gazebo_losses(heavy_below).notes)
    assert "Gazebo refuses the inertia" not in " ".join(gazebo_losses(model_with()).notes)


@pytest.mark.parametrize("name", ["one--two", "one -->", "<b> & ---"])
def test_any_vehicle_name_leaves_the_file_readable(name, model_with):
    _, root = read(model_with(f"vehicle.name={name}"))
    assert root.find("model").get("name") == "vehicle"
