"""The table of the coefficients: complete, and dimensionally sound."""

import pint
import pytest

from auvid_cli.vehicle.coefficients import COEFFICIENTS, MAX_FACTORS, N_COEFFICIENTS, SIGNALS, SYMBOLS
from auvid_cli.vehicle.equations import motion_derivative
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


def test_table_has_valid_rows_and_factors():
    for c in COEFFICIENTS:
        assert c.row in range(6)
        assert 1 <= len(c.factors) <= MAX_FACTORS
        assert {*c.factors} <= {*SIGNALS, *(f"|{signal}|" for signal in SIGNALS)}


def test_each_coefficient_has_a_term_in_the_compiled_equations():
    assert {c.identifier for c in COEFFICIENTS} <= {*motion_derivative.py_func.__code__.co_names}


@pytest.mark.parametrize("quantity", [*PARAMETERS, *MOTION, *INPUTS], ids=lambda q: q.symbol)
def test_every_unit_is_si(quantity):
    assert UNITS.Quantity(1.0, quantity.unit).to_base_units().magnitude == 1.0
