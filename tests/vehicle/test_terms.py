"""Terms of a vehicle's own, anywhere in the equations: against the product that they are, differences, and lanes."""

from functools import reduce

import numpy as np
import pytest
import sympy as sp
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from auvid_cli.numerics import LANES
from auvid_cli.vehicle.coefficients import COEFFICIENTS, SIGNALS, Coefficient, CoefficientSet, unit_of
from auvid_cli.vehicle.equations import N_BLOCK, N_SLOPE, factors, motion_derivative, vehicle_constants
from auvid_cli.vehicle.jacobian import N_COLUMNS, N_JACOBIAN_WORK, motion_jacobian, transition_step, transition_work
from auvid_cli.vehicle.parameters import N_MOTION, ActuatorErrors
from auvid_cli.vehicle.rigid_body import mass_matrix

ACTUATORS = ActuatorErrors(0.8, 0.03, -0.05)


def term(name, *factors):
    row = "XYZKMN".index(name[0])
    return Coefficient(name, unit_of(row, factors), "", row, factors, "term")


any_factor = st.sampled_from([*SIGNALS, *(f"|{signal}|" for signal in SIGNALS)])
any_term = st.builds(
    lambda row, product: term(f"{row}_t", *product),
    st.sampled_from("XYZKMN"),
    st.lists(any_factor, min_size=1, max_size=6),
)
seeds = st.integers(0, 2**32 - 1)


class Draw:
    """A random vehicle and state, with terms: one place for what the tests below share."""

    def __init__(self, seed, terms, random_vehicle, random_state):
        rng = np.random.default_rng(seed)
        self.parameters, self.terms = random_vehicle(rng), terms
        mass = self.parameters["m"]
        motion, of_22, self.inputs = random_state(rng, mass)
        # Away from kinks and zeros.
        self.motion = motion + 0.05 * np.sign(motion)
        self.inputs[2] = mass * (0.2 + abs(self.inputs[2] / mass))
        # Revolutions and voltage stand behind the others.
        self.inputs = np.concatenate([self.inputs, rng.choice([-1.0, 1.0], 2) * rng.uniform(0.2, 2.0, 2)])
        values = dict(zip(COEFFICIENTS.symbols, of_22, strict=True))
        values |= {c.symbol: mass * rng.uniform(-1.0, 1.0) for c in terms}
        self.values, self.of_vehicle = values, CoefficientSet((*COEFFICIENTS, *terms))
        self.factors = factors(values, ACTUATORS, self.of_vehicle)
        self.constants = vehicle_constants(self.parameters, terms)

    def force(self, coefficient):
        """Force or moment of a term, by NumPy alone."""
        acting = ACTUATORS.acting(self.inputs)
        signals = dict(zip(SIGNALS, [*self.motion[:6], *np.delete(acting, 3)], strict=True))
        return self.values[coefficient.symbol] * np.prod(
            [abs(signals[f.strip("|")]) if "|" in f else signals[f] for f in coefficient.factors]
        )


@given(seed=seeds, terms=st.lists(any_term, min_size=1, max_size=4))
def test_terms_add_their_forces(seed, terms, core, random_vehicle, random_state):
    terms = [c._replace(symbol=f"{c.symbol}{i}") for i, c in enumerate(terms)]
    here = Draw(seed, terms, random_vehicle, random_state)
    without = Draw(seed, [], random_vehicle, random_state)
    force = np.zeros(6)
    for c in terms:
        force[c.row] += here.force(c)
    expected = core.derivative(here.motion, without.factors, here.inputs, without.constants)
    expected[:6] += np.linalg.solve(mass_matrix(here.parameters), force)
    found = core.derivative(here.motion, here.factors, here.inputs, here.constants)
    assert_allclose(found, expected, rtol=1e-9, atol=1e-11 * np.abs(expected).max())


def jacobian_of(draw):
    both = np.full((N_MOTION, N_COLUMNS + len(draw.terms)), 7.0)
    of_vehicle = draw.motion, draw.factors, draw.inputs, draw.constants
    motion_jacobian(*of_vehicle, both, both, N_COLUMNS, np.full(N_JACOBIAN_WORK, 7.0))
    return both


@pytest.mark.slow
@given(seed=seeds, product=st.lists(any_factor, min_size=1, max_size=6), row=st.sampled_from("XYZKMN"))
def test_derivatives_of_a_term_are_those_of_its_formula(seed, product, row, random_vehicle, random_state):
    here = Draw(seed, [term(f"{row}_t", *product)], random_vehicle, random_state)
    bare = Draw(seed, [], random_vehicle, random_state)
    change = jacobian_of(here)
    change[:, :N_COLUMNS] -= jacobian_of(bare)
    # By sympy, of the stated product; a modulus is x sign(x).
    names = sp.symbols(SIGNALS, real=True)
    thrust, rudder_trim, elevator_trim, value = others = sp.symbols("gain trim_r trim_e c", real=True)
    acting = dict(zip(SIGNALS, names, strict=True))
    acting |= {"rudder": names[6] + rudder_trim, "elevator": names[7] + elevator_trim, "thrust": names[8] * thrust}
    parts = [sp.Abs(acting[f.strip("|")]) if "|" in f else acting[f] for f in product]
    formula = value * reduce(lambda a, b: a * b, parts)
    at = dict(zip(names, [*here.motion[:6], *np.delete(here.inputs, 3)], strict=True))
    at |= dict(zip(others, [*ACTUATORS, here.values[f"{row}_t"]], strict=True))
    by = {i: formula.diff(x) for i, x in enumerate(names[:6])}
    by |= {N_MOTION + 22 + i: formula.diff(x) for i, x in enumerate(others[:3])} | {N_COLUMNS: formula.diff(value)}
    expected = np.zeros((N_MOTION, N_COLUMNS + 1))
    share = np.linalg.inv(mass_matrix(here.parameters))[:, "XYZKMN".index(row)]
    for column, derivative in by.items():
        expected[:6, column] = share * float(derivative.subs(at))
    assert_allclose(change, expected, rtol=1e-8, atol=1e-9 * max(1.0, np.abs(jacobian_of(bare)).max()))


def test_transition_has_the_column_of_a_term(core, random_vehicle, random_state):
    terms = [term("N_|v|r", "|v|", "r"), term("K_up", "u", "p"), term("X_Tu", "thrust", "u")]
    here = Draw(3, terms, random_vehicle, random_state)
    motion, step = here.motion.copy(), 0.001
    transition = np.hstack([np.eye(N_MOTION), np.zeros((N_MOTION, here.factors.size))])
    values = 0.01 * here.factors
    work = np.full(transition_work(len(terms)), 7.0)
    transition_step(motion, values, here.inputs, here.constants, step, transition, work)
    for t in range(1, len(terms) + 1):
        more, less = values.copy(), values.copy()
        by = 0.1 * abs(values[-t])
        more[-t] += by
        less[-t] -= by
        ends = [core.advance(here.motion, x, here.inputs, here.constants, 1, step)[-1] for x in (more, less)]
        difference = (ends[0] - ends[1]) / (2.0 * by)
        assert_allclose(transition[:, -t], difference, rtol=1e-5, atol=1e-6 * np.abs(difference).max())
    assert_allclose(motion, core.advance(here.motion, values, here.inputs, here.constants, 1, step)[-1], rtol=1e-12)


@pytest.mark.parametrize("n_lanes", [1, 7, LANES])
def test_lanes_with_terms_are_independent_of_each_other(n_lanes, core, random_vehicle, random_state):
    terms = [term("Y_|v|r", "|v|", "r"), term("X_dd", "u", "u", "rudder", "rudder")]
    draws = [Draw(seed, terms, random_vehicle, random_state) for seed in range(n_lanes)]
    first = draws[0]
    rows = [np.zeros((values.size, LANES)) for values in (first.motion, first.factors)]
    for k, each in enumerate(draws):
        rows[0][:, k], rows[1][:, k] = each.motion, each.factors
    slope = np.full(N_SLOPE, 7.0)
    motion_derivative(rows[0].ravel(), rows[1].ravel(), first.inputs, first.constants, n_lanes, slope)
    found = slope[:N_BLOCK].reshape(N_MOTION, LANES)
    alone = [core.derivative(d.motion, d.factors, first.inputs, first.constants) for d in draws]
    assert_allclose(found[:, :n_lanes], np.transpose(alone), rtol=1e-12, atol=1e-12)
    assert (found[:, n_lanes:] == 7.0).all()


@pytest.mark.parametrize("coefficient", COEFFICIENTS, ids=COEFFICIENTS.symbols)
def test_the_unit_of_a_term_follows_from_row_and_factors(coefficient):
    assert unit_of(coefficient.row, coefficient.factors) == coefficient.unit


@pytest.mark.parametrize(
    ("one", "other", "same"),
    [
        (("|v|", "r"), ("r", "|v|"), True),
        (("|v|", "|v|"), ("v", "v"), True),
        (("|v|", "v", "|v|"), ("v", "v", "v"), True),
        (("|v|", "v"), ("v", "v"), False),
        (("v", "r"), ("|v|", "r"), False),
        (("u", "p"), ("u", "p", "p"), False),
    ],
)
def test_terms_are_the_same_if_they_are_so_for_every_motion(one, other, same):
    assert (term("N_a", *one).regressor == term("N_b", *other).regressor) is same
    assert term("N_a", *one).regressor != term("M_a", *one).regressor
