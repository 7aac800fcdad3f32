"""Two results beside each other, against what is known of them."""

from math import inf, isnan, nextafter

import pytest
from hypothesis import given
from hypothesis import strategies as st

from auvid_cli.data.checks import Tolerance, compare_tables

KEY = ("ckf", "X_u|u|")


def coefficients(**cells):
    row = {"unit": "kg/m", "true": "-5", "estimate": "-5.1", "standard_deviation": "0.1", "rmse": "0.4"}
    return {"coefficients": {KEY: row | {"identified": "True"} | cells}}


def differing(first, second, tolerance=None):
    return [value.column for value in compare_tables(first, second, tolerance or Tolerance()).differing()]


def test_a_result_agrees_with_itself_to_the_letter():
    comparison = compare_tables(coefficients(), coefficients(), Tolerance(0.0, {}, 0.0))
    assert (comparison.differing(), comparison.only_first) == ([], [])
    assert len(comparison.values) == 6


@pytest.mark.parametrize(
    ("column", "within", "beyond"),
    [
        # A hundredth of the standard deviation of 0.1, and 1 % of the larger value.
        ("estimate", "-5.1009", "-5.1011"),
        ("rmse", "0.4040", "0.4041"),
        ("unit", "kg/m", "kg*m"),
        ("identified", "True", "False"),
        ("rmse", "0.4", ""),
    ],
)
def test_by_default_numbers_differ_beyond_a_percent_and_estimates_beyond_a_hundredth_of_a_deviation(
    column, within, beyond
):
    assert differing(coefficients(**{column: within}), coefficients()) == []
    assert differing(coefficients(**{column: beyond}), coefficients()) == [column]


def test_an_error_in_percent_may_move_as_its_estimate_may():
    """By 0.01 * 0.1 of a true value of 5: 0.02 %."""
    first, second = (coefficients(steady_state_error_percent=text) for text in ("2.019", "2"))
    assert differing(first, second) == []
    assert differing(coefficients(steady_state_error_percent="2.021"), second) == ["steady_state_error_percent"]


def test_what_takes_time_or_is_a_sentence_is_compared_only_if_asked_for():
    first, second = (coefficients(cpu_time_s=text, reason=text) for text in ("1", "2"))
    assert differing(first, second) == []
    assert differing(first, second, Tolerance(0.1)) == []
    assert differing(first, second, Tolerance(None, {"cpu_time_s": 0.4})) == ["cpu_time_s"]
    assert differing(first, second, Tolerance(None, {"cpu_time_s": 0.5})) == []


def test_a_share_of_one_column_counts_more_than_that_of_all():
    first, second = coefficients(rmse="0.5", estimate="-6"), coefficients()
    assert differing(first, second, Tolerance(0.2)) == []
    assert differing(first, second, Tolerance(0.2, {"rmse": 0.1})) == ["rmse"]
    assert differing(first, second, Tolerance(0.0, {"rmse": inf, "estimate": inf})) == []


def test_what_the_second_has_the_first_must_have_and_not_the_other_way_round():
    more = coefficients(bound="1") | {"summary": {("ckf",): {"grade": "sound"}, ("ukf",): {"grade": "sound"}}}
    comparison = compare_tables(more, coefficients() | {"summary": {("ckf",): {"grade": "sound"}}}, Tolerance())
    assert (comparison.differing(), comparison.only_first) == ([], ["ukf", "coefficients.bound"])
    lacking = compare_tables(coefficients(), more, Tolerance()).differing()
    assert [(value.table, value.row, value.column) for value in lacking] == [
        ("coefficients", "ckf X_u|u|", "bound"),
        ("summary", "ckf", ""),
        ("summary", "ukf", ""),
    ]


def test_the_worst_comes_first():
    first = coefficients(estimate="-5.103", rmse="0.8", unit="m")
    assert differing(first, coefficients()) == ["unit", "rmse", "estimate"]


@given(st.floats(-1e300, 1e300), st.floats(-1e300, 1e300), st.floats(0.0, 2.0))
def test_numbers_agree_one_way_as_the_other(a, b, share):
    first, second = coefficients(rmse=repr(a)), coefficients(rmse=repr(b))
    tolerance = Tolerance(share)
    assert differing(first, second, tolerance) == differing(second, first, tolerance)
    assert differing(first, second, Tolerance(nextafter(2.0, inf))) == []


def test_what_is_no_number_has_no_difference():
    (value,) = compare_tables(coefficients(rmse=""), coefficients(), Tolerance()).differing()
    assert isnan(value.difference)
    assert value.severity == inf
