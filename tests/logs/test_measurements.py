import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from auvid_cli.logs.clock import Order
from auvid_cli.logs.measurements import MeasuredRows, without_repeats

NUMBER = st.one_of(st.just(np.nan), st.integers(0, 2).map(float))


@given(st.lists(st.tuples(NUMBER, NUMBER), min_size=1, max_size=30))
def test_repeated_rows_are_left_out(rows):
    """Against a walk that remembers the last number of each component, missing ones in between or not."""
    last, kept = {}, []
    for k, row in enumerate(rows):
        news = {name: number for name, number in zip("uv", row, strict=True) if not np.isnan(number)}
        if k == 0 or any(last.get(name) != number for name, number in news.items()):
            kept.append(k)
        last |= news
    values = {name: np.array([row[column] for row in rows]) for column, name in enumerate("uv")}
    time = np.arange(len(rows), dtype=float)
    found = without_repeats(MeasuredRows(time, values, Order(slice(None)), 0, 0, 0, None, []))
    assert found.time.tolist() == kept
    assert found.repeats == len(rows) - len(kept)
    for name, numbers in values.items():
        np.testing.assert_array_equal(found.values[name], numbers[kept])
