"""The table of the coefficients: complete, and dimensionally sound."""

import pint
import pytest

from auvid_cli.vehicle.coefficients import COEFFICIENTS, N_COEFFICIENTS, SYMBOLS, check_table
from auvid_cli.vehicle.equations import check_terms, motion_derivative
from auvid_cli.vehicle.parameters import INPUTS, MOTION, PARAMETERS

UNITS = pint.UnitRegistry()
UNIT_OF_SIGNAL = {quantity.symbol: quantity.unit for quantity in (*MOTION, *INPUTS)}

# Table II of the paper, row by row of the equations of motion; v2 stands for |v| v, and so on.
TABLE_II = {
    "X": "u2",
    "Y": "v2 r2 ur uv uudr",
    "Z": "w2 q2 uq uw uude",
    "K": "p2",
    "M": "w2 q2 uw uq uude",
    "N": "v2 r2 uv ur uudr",
}


def test_the_table_has_22_rows_with_symbols_of_their_own():
    assert N_COEFFICIENTS == len(COEFFICIENTS) == len(set(SYMBOLS))


def test_the_table_holds_the_terms_of_table_ii():
    short = {"rudder": "dr", "elevator": "de"}
    terms = {row: set() for row in TABLE_II}
    for c in COEFFICIENTS:
        name = f"{c.signals[0]}2" if c.group == "damping" else "".join(short.get(s, s) for s in c.signals)
        terms["XYZKMN"[c.row]].add(name)
    assert terms == {row: set(names.split()) for row, names in TABLE_II.items()}


@pytest.mark.parametrize("coefficient", COEFFICIENTS, ids=SYMBOLS)
def test_symbol_names_the_row_and_the_signals(coefficient):
    row, _, signals = coefficient.symbol.partition("_")
    assert row == "XYZKMN"[coefficient.row]
    first, *rest = coefficient.signals
    expected = {
        "damping": f"{first}|{first}|",
        "lift": f"{first}{''.join(rest)}l",
        "control": f"uud{coefficient.signals[-1][0]}",
    }
    assert signals == expected[coefficient.group]


@pytest.mark.parametrize("coefficient", COEFFICIENTS, ids=SYMBOLS)
def test_coefficient_times_signals_is_a_force_or_a_moment(coefficient):
    term = UNITS.Quantity(1.0, coefficient.unit)
    for signal in coefficient.signals:
        term = term * UNITS.Quantity(1.0, UNIT_OF_SIGNAL[signal])
    expected = UNITS.Quantity(1.0, "N" if coefficient.row < 3 else "N*m").to_base_units()
    # Radians must cancel too, although pint would forgive them.
    assert term.to_base_units().units == expected.units
    assert term.to_base_units().magnitude == 1.0


@pytest.mark.parametrize("coefficient", COEFFICIENTS, ids=SYMBOLS)
def test_equation_reads_like_the_term_itself(coefficient):
    left, right = coefficient.equation.split(" += ")
    symbol, *factors = right.split()
    assert (left, symbol) == ("XYZKMN"[coefficient.row], coefficient.symbol)
    assert tuple(factors) == coefficient.factors


@pytest.mark.parametrize("factors", [(), ("u",) * 7, ("u", "psi"), ("|u", "u"), ("u**2",)])
def test_a_row_that_nobody_could_read_is_refused_at_import(factors):
    with pytest.raises(ValueError, match="N_x: the factors"):
        check_table([COEFFICIENTS[0]._replace(symbol="N_x", factors=factors)])


def test_a_row_of_equations_that_does_not_exist_is_refused():
    with pytest.raises(ValueError, match="no row 6"):
        check_table([COEFFICIENTS[0]._replace(row=6)])


def test_a_coefficient_without_its_term_in_the_equations_is_refused_at_import():
    check_terms([coefficient.identifier for coefficient in COEFFICIENTS], motion_derivative)
    with pytest.raises(TypeError, match="no term with Y_pp"):
        check_terms(["X_uu", "Y_pp"], motion_derivative)


@pytest.mark.parametrize("quantity", [*PARAMETERS, *MOTION, *INPUTS], ids=lambda q: q.symbol)
def test_every_unit_is_si(quantity):
    assert UNITS.Quantity(1.0, quantity.unit).to_base_units().magnitude == 1.0
