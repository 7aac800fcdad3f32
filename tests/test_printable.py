"""Text of a user's file in one line of signs that are all to be seen."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from auvid_cli.text import one_line, printable, printable_lines


@given(st.text())
def test_nothing_is_left_that_is_not_seen(text):
    assert printable(text).isprintable()
    assert one_line(text).isprintable()
    assert printable_lines(text).count("\n") == text.count("\n")


@given(st.text(st.characters(categories=["L", "N", "P", "S", "Zs"])))
def test_what_is_seen_stays_as_it_is(text):
    assert printable(text) == text or not text.isprintable()


@pytest.mark.parametrize(
    ("text", "expected"),
    [("\x1b[2J", r"\x1b[2J"), ("a\u202eb", r"a\u202eb"), ("\ud800", r"\ud800"), ("é ° µ 水", "é ° µ 水")],
)
def test_what_steers_is_written_out(text, expected):
    assert printable(text) == expected


def test_room_is_one_blank_in_a_line():
    assert one_line("  a \r\n\t b\u2028c\x85") == "a b c"
