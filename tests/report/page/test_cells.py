import pytest

from auvid_cli.report.page.render import heading_rows, shown, symbol_parts, with_symbols, with_ties
from auvid_cli.report.table import Column, PlusMinus, Symbol, Table, Unidentified, UnitCell
from auvid_cli.vehicle.coefficients import SYMBOLS


@pytest.mark.parametrize(
    ("symbol", "parts"),
    [
        ("X_u|u|", ("X", "u|u|")),
        ("Y_uudr", ("Y", "uuδr")),
        ("psi", ("ψ", "")),
        ("heading", ("ψ", "")),
        ("u", ("u", "")),
        ("down", ("depth", "")),
        ("dvl_scale", ("s", "DVL")),
        ("fx", ("f", "x")),
    ],
)
def test_a_symbol_is_a_letter_and_what_stands_lower(symbol, parts):
    assert symbol_parts(symbol) == parts


@pytest.mark.parametrize("symbol", SYMBOLS)
def test_a_coefficient_in_a_text_is_found_and_nothing_is_lost(symbol):
    first, (after, below) = with_symbols(f"of {symbol}, at the end")
    letter, subscript = symbol_parts(symbol)
    assert first == (f"of {letter}", subscript)
    assert (after, below) == (", at the end", "")


@pytest.mark.parametrize("text", ["a_b <i> X_none", "N_r|r|r is a term of its own", "and N_url2, |N_url|"])
def test_a_text_without_coefficients_stays_as_it_is(text):
    assert with_symbols(text) == [(text, "")]


@pytest.mark.parametrize(
    ("cell", "text", "order"),
    [
        (None, "—", ""),
        (2.0, "2.000", 2.0),
        (float("nan"), "—", ""),
        (float("inf"), "—", ""),
        (PlusMinus(-3.0, 0.25), "-3.000 ± 0.25", -3.0),
        (Unidentified(PlusMinus(5.0, 2.0)), "5.000 ± 2.0 †", 5.0),
        (UnitCell("kg*m^2"), "kg·m²", ""),
        ("0.0201", "0.0201", 0.0201),
        ("Gyro\nscope", "Gyro scope", "gyro scope"),
    ],
)
def test_a_cell_is_shown_and_sorted_by_what_it_is(cell, text, order):
    assert (shown(cell).text, shown(cell).order) == (text, order)


def test_a_symbol_is_found_by_its_name_in_auvid():
    assert shown(Symbol("Y_uudr")).found == "Y_uudr"


def test_the_name_of_a_term_is_shown_as_a_symbol_though_it_comes_as_text():
    assert shown("N_|v|r") == shown(Symbol("N_|v|r"))
    assert (shown("N_|v|r").text, shown("N_|v|r").below) == ("N", "|v|r")


def test_groups_stand_above_their_columns():
    columns = (
        Column("Coefficient", numeric=False),
        *(Column("EKF", "RMSE"), Column("CKF", "RMSE"), Column("EKF", "RMSE, *paper*")),
    )
    upper, lower = heading_rows(Table("key", "Title", columns, []))
    assert [(h.text, h.columns, h.rows) for h in upper] == [
        ("Coefficient", 1, 2),
        ("RMSE", 2, 1),
        ("RMSE, paper", 1, 1),
    ]
    assert [h.text for h in lower] == ["EKF", "CKF", "EKF"]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("theta 1, phi 1, psi 0.999", "theta~1, phi~1, psi~0.999"),
        ("theta by surge_force 0.321, phi by p -1e-05", "theta by surge_force~0.321, phi by p~-1e-^05"),
        ("0.9879 to 1.012 (chi-squared, 99%), tolerance 0.05", "0.9879 to 1.012 (chi-squared, 99%), tolerance~0.05"),
        ("<= 4", "<=~4"),
        ("over 20 lags", "over 20 lags"),
        ("EKF 0.29 %, CKF 0.3 %.", "EKF~0.29~%, CKF~0.3~%."),
        ("EKF 0.062 °/s, within 20 % or better", "EKF~0.062~°/s, within 20~% or better"),
        ("at the end EKF 7.7e-05 %", "at the end EKF~7.7e-^05~%"),
    ],
)
def test_no_line_ends_between_a_name_and_its_number(text, expected):
    assert with_ties(text) == expected.replace("~", "\N{NO-BREAK SPACE}").replace("^", "\N{WORD JOINER}")
