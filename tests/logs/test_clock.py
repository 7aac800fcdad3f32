import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from auvid_cli.logs.clock import find_restarts, order_rows, slashed_date_formats, to_seconds


def test_numbers_are_scaled():
    assert to_seconds(np.array([1e6, 2.5e6]), 1e-6).seconds.tolist() == [1.0, 2.5]


def test_clock_without_hours_continues_after_rollover():
    clock = to_seconds(np.array(["59:58.5", "59:59.5", "", "00:00.5", "00:01.5"]), 1.0)
    assert clock.rollovers == 1
    assert clock.seconds[[0, 1, 3, 4]].tolist() == [3598.5, 3599.5, 3600.5, 3601.5]
    assert np.isnan(clock.seconds[2])


def test_clock_without_date_continues_after_midnight():
    clock = to_seconds(np.array(["23:59:59.25", "00:00:00.25"]), 1.0)
    assert (clock.seconds.tolist(), clock.rollovers) == ([86399.25, 86400.25], 1)


@given(st.floats(0, 3599), st.integers(2, 300))
def test_text_clock_equals_seconds(begin, n):
    seconds = np.round(begin, 1) + 37.5 * np.arange(n)
    texts = np.array([f"{int(s % 3600) // 60:02d}:{s % 60:04.1f}" for s in seconds])
    found = to_seconds(texts, 1.0)
    assert np.diff(found.seconds) == pytest.approx(np.full(n - 1, 37.5), abs=0.11)
    assert found.rollovers == int(seconds[-1] // 3600) - int(seconds[0] // 3600)


def test_small_backward_step_is_not_a_rollover():
    assert to_seconds(np.array(["10:05.0", "10:04.0"]), 1.0).rollovers == 0


def test_dates_are_seconds_since_the_epoch():
    texts = np.array(["2025-04-04T22:23:02.5Z", " 2025-04-05 00:23:03.5+02:00", ""])
    seconds = to_seconds(texts, 1.0).seconds
    # date -u -d 2025-04-04T22:23:02 +%s
    assert seconds[:2] == pytest.approx([1743805382.5, 1743805383.5], abs=1e-6)
    assert np.isnan(seconds[2])


@pytest.mark.parametrize("texts", [["noon"], ["10:05.0", "later"], ["2025-04-04", "soon"]])
def test_invalid_text_raises_value_error(texts):
    with pytest.raises(ValueError, match=texts[-1]):
        to_seconds(np.array(texts), 1.0)


def test_huge_numbers_are_missing_times():
    seconds = to_seconds(np.array([-1e308, 1e9, 1e308, 2e9]), 1e-9).seconds
    np.testing.assert_array_equal(seconds, [np.nan, 1.0, np.nan, 2.0])


def test_order_counts_disordered_rows():
    order = order_rows(np.array([0.0, 2.0, 1.0, np.nan, 1.0, 3.0]))
    assert np.array([0.0, 2.0, 1.0, np.nan, 1.0, 3.0])[order.rows].tolist() == [0.0, 1.0, 2.0, 3.0]
    assert order[1:] == (1, 1, 1.0, 1)
    assert order.rows.tolist() == [0, 2, 1, 5]


@given(st.lists(st.integers(-50, 50), max_size=30))
def test_ordered_times_are_unique(times):
    seconds = np.array(times, float)
    order = order_rows(seconds)
    assert seconds[order.rows].tolist() == sorted(set(times))
    assert order.duplicates == len(times) - len(set(times))


@pytest.mark.parametrize("text", ["99:99:05", "12:60:00", "12:00:61", "60:00", "10:75.5"])
def test_time_that_no_clock_shows_is_refused(text):
    for times in ([text], ["00:00:01", text]):
        with pytest.raises(ValueError, match="is not a time"):
            to_seconds(np.array(times), 1.0)


@pytest.mark.parametrize("year", ["0000", "1600", "1677", "2263", "9999", "10000"])
def test_year_outside_nanoseconds_is_refused(year):
    for times in ([f"{year}-01-01T00:00:00Z"], ["2025-04-04T00:00:00Z", f"{year}-01-01T00:00:00Z"]):
        with pytest.raises(ValueError, match="is not a"):
            to_seconds(np.array(times), 1.0)


def test_leap_second_and_early_year_are_read():
    assert to_seconds(np.array(["23:59:59", "23:59:60"]), 1.0).seconds.tolist() == [86399.0, 86400.0]
    assert to_seconds(np.array(["1700-01-01"]), 1.0).seconds == pytest.approx([-8520336000.0])


@pytest.mark.parametrize(
    "texts",
    [
        ("2024-06-10 08:00:00,000", "2024-06-10 08:00:00,100"),
        ("10.06.2024 08:00:00,000", "10.06.2024 08:00:00,100"),
        ("10.06.2024 08:00:00.000", "10.06.2024 08:00:00.100"),
    ],
)
def test_dates_with_commas_and_points_are_read(texts):
    # 2024-06-10 08:00 UTC is 1718006400 s after 1970.
    assert to_seconds(np.array(texts), 1.0).seconds == pytest.approx([1718006400.0, 1718006400.1], abs=1e-6)


def test_date_with_slashes_needs_format():
    texts = np.array(["06/10/2024 08:00:00.000", "06/10/2024 08:00:00.100"])
    with pytest.raises(ValueError, match="state the `format`"):
        to_seconds(texts, 1.0)
    found = to_seconds(texts, 1.0, "%m/%d/%Y %H:%M:%S.%f").seconds
    assert found == pytest.approx([1718006400.0, 1718006400.1], abs=1e-6)
    assert slashed_date_formats(texts) == ("%d/%m/%Y %H:%M:%S.%f", "%m/%d/%Y %H:%M:%S.%f")
    assert slashed_date_formats(np.array(["13/10/2024 08:00:00"])) == ("%d/%m/%Y %H:%M:%S",)
    assert slashed_date_formats(np.array(["10/13/2024 08:00:00"])) == ("%m/%d/%Y %H:%M:%S",)


def test_restart_differs_from_late_row():
    assert find_restarts(np.array([0.0, 10.0, 20.0, 0.0, 10.0, 20.0])).tolist() == [3]
    assert find_restarts(np.array([0.0, 10.0, 5.0, 20.0, 30.0])).tolist() == []
    assert find_restarts(np.array([0.0, np.nan, 10.0, np.nan, 1.0, 2.0])).tolist() == [4]
