import numpy as np
import pytest

from auvid_cli.evaluation.estimate_checks import near_its_geometry


@pytest.fixture
def found(hand_made, experiment_with):
    """Function: the verdict on an estimate that ends at some coefficients of the vehicle of the paper."""

    def of(**values):
        return near_its_geometry(hand_made([0.0, 1.0], {symbol: [0.0, value] for symbol, value in values.items()}))

    return of


def test_what_a_drawing_lets_expect_passes(found, experiment_with):
    expected = {each.name: each.mean for each in experiment_with().vehicle.derived_values()}
    (verdict,) = found(N_uudr=expected["N_uudr"], Y_uvl=expected["Y_uvl"])
    assert verdict.passed
    assert not verdict.advice


def test_what_is_beyond_four_standard_deviations_is_a_remark(found, experiment_with):
    derived = {each.name: each for each in experiment_with().vehicle.derived_values()}
    fin = derived["N_uudr"]
    (near,) = found(N_uudr=fin.mean + 3.9 * fin.standard_deviation)
    (far,) = found(N_uudr=fin.mean + 4.5 * np.hypot(fin.standard_deviation, 0.25), Y_uvl=derived["Y_uvl"].mean)
    assert near.passed
    assert far.passed is None
    assert far.statistic == "N_uudr 4.5 sd"


def test_nothing_is_said_where_no_geometry_is_stated(hand_made, experiment_with):
    from dataclasses import replace

    estimate = hand_made([0.0, 1.0], {"N_uudr": [0.0, 1000.0]})
    bare = replace(estimate, experiment=experiment_with("vehicle.geometry=null"))
    assert near_its_geometry(bare) == []
