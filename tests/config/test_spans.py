from math import inf

import pytest

from auvid_cli.config.identification import Use
from auvid_cli.config.settings import parse_separate_spans, parse_spans


@pytest.mark.parametrize("parse", [parse_spans, parse_separate_spans])
def test_one_span_is_a_list_of_one(parse):
    assert parse(["1 min", 70]) == parse([["60 s", "70 s"]]) == ((60.0, 70.0),)
    assert parse([]) == ()


@pytest.mark.parametrize(
    ("value", "message"),
    [
        (3, "expected a list of"),
        ([1, 2, 3], "for each span"),
        ([[1, 2], 3], "for each span"),
        ([[2, 1]], r"span \[2, 1\] s"),
        ([["1 m", 2]], "expected a time"),
    ],
)
def test_invalid_span_raises(value, message):
    with pytest.raises(ValueError, match=message):
        parse_spans(value)


def test_separate_spans_must_not_overlap():
    assert parse_spans([[1, 5], [4, 6]]) == ((1.0, 5.0), (4.0, 6.0))
    with pytest.raises(ValueError, match="overlap from 4 s to 5 s"):
        parse_separate_spans([[4, 6], [1, 5]])


def test_null_means_open_end_and_survives_dump():
    stated = [[None, "20 s"], [30, 40], ["1 min", None]]
    use = Use.model_validate({"spans": stated})
    assert use.spans == ((-inf, 20.0), (30.0, 40.0), (60.0, inf))
    written = use.model_dump(mode="json")["spans"]
    assert written == [[None, 20.0], [30.0, 40.0], [60.0, None]]
    assert Use.model_validate({"spans": written}) == use


@pytest.mark.parametrize(
    "wrong", [[[None, 20], [10, 30]], [[10, None], [50, 60]], [[float("inf"), 3]], [[3, float("nan")]]]
)
def test_overlapping_open_spans_and_infinite_numbers_raise(wrong):
    with pytest.raises(ValueError, match=r"overlap|got inf|got nan"):
        Use.model_validate({"spans": wrong})
