import numpy as np
import pytest
from numpy.testing import assert_allclose

from auvid_cli.export.model import held_inputs, term_histories, term_sizes
from auvid_cli.vehicle.coefficients import COEFFICIENTS, N_COEFFICIENTS, SYMBOLS
from auvid_cli.vehicle.rigid_body import mass_matrix


def test_terms_add_up_to_the_core(skewed, derivative_of, draw):
    states = [draw(seed) for seed in range(20)]
    motion, inputs = (np.array(each) for each in zip(*states, strict=True))
    of_vehicle = skewed.coefficient_set
    terms = term_histories(of_vehicle, {each.symbol: each.value for each in skewed.coefficients}, motion, inputs)
    mass = mass_matrix(skewed.experiment.vehicle.known_parameters())
    for own, *state in zip(terms, motion, inputs, strict=True):
        with_them, without = derivative_of(skewed, *state), derivative_of(skewed, *state, np.zeros(len(of_vehicle)))
        by_row = np.bincount([c.row for c in of_vehicle], own, minlength=6)
        assert_allclose(by_row, mass @ (with_them - without)[:6], rtol=1e-10, atol=1e-10)


@pytest.mark.parametrize("symbol", [*SYMBOLS, "N_|v|r", "K_T"])
def test_each_term_depends_on_its_coefficient_only(symbol, skewed, derivative_of, draw):
    motion, inputs = draw(7)
    of_vehicle, symbols = skewed.coefficient_set, skewed.coefficient_set.symbols
    alone = np.where(np.array(symbols) == symbol, 2.5, 0.0)
    terms = term_histories(of_vehicle, dict(zip(symbols, alone, strict=True)), motion[None], inputs[None])
    acceleration = (derivative_of(skewed, motion, inputs, alone) - derivative_of(skewed, motion, inputs, 0 * alone))[:6]
    force = mass_matrix(skewed.experiment.vehicle.known_parameters()) @ acceleration
    coefficient = of_vehicle[symbols.index(symbol)]
    assert_allclose(terms[0, symbols.index(symbol)], force[coefficient.row], rtol=1e-10)
    assert np.count_nonzero(terms) == 1


def test_percent_is_finite_where_terms_cancel():
    terms = np.zeros((2, N_COEFFICIENTS))
    terms[:, SYMBOLS.index("Y_uvl")] = 3.0, -3.0
    terms[:, SYMBOLS.index("Y_url")] = -4.0, 4.0
    terms[:, SYMBOLS.index("K_p|p|")] = 1.0, 7.0
    sizes = {size.symbol: size for size in term_sizes(COEFFICIENTS, terms)}
    assert sizes["Y_uvl"] == ("Y_uvl", "Y", "N", 3.0, pytest.approx(60.0))
    assert sizes["Y_url"] == ("Y_url", "Y", "N", 4.0, pytest.approx(80.0))
    assert sizes["K_p|p|"] == ("K_p|p|", "K", "N*m", 5.0, pytest.approx(100.0))
    assert sizes["Y_uudr"].percent == 0.0
    assert sizes["X_u|u|"].percent == 0.0


def test_input_holds_from_its_time():
    values = np.arange(8.0).reshape(2, 4)
    held = held_inputs(np.array([1.0, 1.9, 2.0, 5.0]), np.array([1.0, 2.0]), values)
    assert held[:, 0].tolist() == [0.0, 0.0, 4.0, 4.0]


def test_inputs_are_compared_in_nanoseconds():
    by_log, by_filter = 3 * 0.1, 0.3
    assert by_log > by_filter
    held = held_inputs(np.array([by_filter]), np.array([0.0, by_log]), np.arange(8.0).reshape(2, 4))
    assert held[0, 0] == 4.0
