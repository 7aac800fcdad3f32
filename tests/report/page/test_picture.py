import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from auvid_cli.report.page.parts import Axis, TextLabel, decades, stroke


@given(st.floats(-1e6, 1e6), st.floats(1e-3, 1e6), st.integers(2, 12))
def test_ticks_are_few_round_and_on_the_axis(low, length, most):
    axis = Axis(low, low + length, 0.0, 100.0)
    ticks = axis.ticks(most)
    assert len(ticks) <= most + 1
    assert all(low - 1e-6 * length <= tick <= low + length + 1e-6 * length for tick in ticks)
    if len(ticks) > 1:
        step = ticks[1] - ticks[0]
        digit = step / 10.0 ** np.floor(np.log10(step) + 1e-9)
        assert min(abs(digit - known) for known in (1.0, 2.0, 5.0)) < 1e-3


def test_values_lie_between_the_ends_of_their_axis():
    axis = Axis(-2.0, 2.0, 300.0, 100.0)
    assert [axis.at(value) for value in (-2.0, 0.0, 2.0)] == [300.0, 200.0, 100.0]


def test_a_long_line_keeps_its_ends():
    x = np.linspace(0.0, 1.0, 100_000)
    points = stroke(x, x**2, Axis(0.0, 1.0, 0.0, 10.0), Axis(0.0, 1.0, 10.0, 0.0), "true").points
    assert len(points) < 1000
    np.testing.assert_allclose(points[[0, -1]], [[0.0, 10.0], [10.0, 0.0]])
    np.testing.assert_allclose(points[:, 1], 10.0 - points[:, 0] ** 2 / 10.0, atol=1e-9)


def test_no_axis_is_upside_down():
    assert Axis(0.0, 10.0, 0.0, 1.0).ticks() == pytest.approx([0.0, 2.0, 4.0, 6.0, 8.0, 10.0])


@pytest.mark.parametrize(
    ("high", "named"),
    [(1.0, ["1", "2", "5", "10"]), (3.0, ["1", "10", "100", "1000"])],
)
def test_a_logarithmic_axis_has_numbers_enough_to_read_values(high, named):
    shapes = decades(Axis(0.0, high, 0.0, 300.0), 0.0, 50.0)
    assert [shape.text for shape in shapes if isinstance(shape, TextLabel)] == named
