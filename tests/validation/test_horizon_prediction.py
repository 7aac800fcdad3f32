"""Targets and rows of predictions ahead, against values by hand."""

import numpy as np
import pytest

from auvid_cli.validation.motion_prediction import MeasuredSignal, SignalSize
from auvid_cli.validation.predictions import Collected, Sample, Target, _variance, evenly_spaced, rows_ahead, targets_of

TIME = np.arange(0.0, 100.0, 0.25)
# Up and down by 2 about 7.
SIGNAL = MeasuredSignal(TIME, 7.0 + 2.0 * (-1.0) ** np.arange(TIME.size), 0.1)
SIZE = SignalSize(0.1, 4.0)


def collected(predictions, variance, blown_up=(False, True)):
    """Samples of u, all measurement 9, ten starts or more."""
    target = Target(5.0, 0, 20.0, 9.0, 0.1)
    samples = [Sample(target, np.array(each), 9.0 + 3.0, variance) for each in predictions]
    return Collected(samples, np.array(blown_up))


def test_rows_relate_errors_to_run_and_stated_variance():
    # The identified model is off by 0.5 and by 1.0 in turn, the prior by 4.
    data = collected([(9.5, 5.0), (8.0, 5.0)] * 6, 0.4**2)
    (row,) = rows_ahead(data, ("identified", "prior"), {"u": SIZE}, {})
    rmse = np.sqrt((0.5**2 + 1.0**2) / 2.0)
    assert (row.signal, row.kind, row.horizon_s, row.measurements, row.noise) == ("u", "ahead", 5.0, 12, 0.1)
    assert row.rmse == pytest.approx(rmse)
    assert row.fit_percent == pytest.approx(100.0 * (1.0 - rmse / 2.0))
    assert (row.prior_rmse, row.vehicle_file_rmse, row.constant_velocity_rmse) == (4.0, None, 3.0)
    assert row.expected_rmse == pytest.approx(0.4)
    assert row.share_within_band == 0.5
    assert (row.draws, row.draws_blown_up) == (2, 1)


def test_too_few_starts_give_no_row():
    assert list(rows_ahead(collected([(9.0,)] * 9, 1.0), ("identified",), {"u": SIZE}, {})) == []


def test_diverged_model_has_no_numbers():
    (row,) = rows_ahead(collected([(9.0,)] * 11 + [(np.nan,)], 1.0), ("identified",), {"u": SIZE}, {})
    assert (row.rmse, row.fit_percent, row.share_within_band) == (None, None, None)


def test_target_is_first_measurement_after_horizon():
    silent = (TIME > 11.1) & (TIME < 14.9)
    signal = MeasuredSignal(TIME[~silent], SIGNAL.values[~silent], 0.1)
    times = {target.horizon: target.time for target in targets_of({"u": signal}, 10.1)}
    # From 11.1 s on nothing is said until 15 s: 1 s and 2 s ahead have no measurement soon enough.
    assert times == {0.5: 10.75, 5.0: 15.25, 10.0: 20.25, 20.0: 30.25, 50.0: 60.25}


def test_starts_leave_time_to_settle_and_predict():
    np.testing.assert_allclose(evenly_spaced(0.0, 100.0, 3), [5.0, 52.25, 99.5])
    np.testing.assert_allclose(evenly_spaced(10.0, 20.0, 2), [11.0, 19.5])
    assert evenly_spaced(0.0, 0.5, 10).size == 0


def test_variance_ignores_diverged_draws():
    assert np.isnan(_variance(np.array([1.0, 3.0, 1e200, np.nan]), 2.0))
    assert _variance(np.array([1.0, 3.0, 3.0, 1e200, np.inf]), 2.0) == 1.0
