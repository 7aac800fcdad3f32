"""How strongly fins act is held against the vehicle file, where the data tell it."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.signal import savgol_filter

from auvid_cli.data.signals import rate_of_change, response_to_rates
from auvid_cli.inspection.inspect import inspect_dataset

RUDDER, ELEVATOR = ("rudder", "strength"), ("elevator", "strength")


def verdicts(dataset):
    return {(check.subject, check.check): check for check in inspect_dataset(dataset).checks}


def size(check):
    return float(check.statistic.split()[0])


def with_fins(dataset, factor):
    return replace(dataset, inputs=replace(dataset.inputs, values=dataset.inputs.values * [factor, factor, 1.0, 1.0]))


@pytest.fixture(scope="module")
def sound(sound_run):
    """Verdicts on the long spiral without any fault."""
    return verdicts(sound_run("long_spiral"))


@pytest.mark.slow
@pytest.mark.parametrize("factor", [0.5, -0.5, 2.0])
def test_wrong_fin_scale_fails_against_vehicle_file(factor, sound, sound_run):
    changed = verdicts(with_fins(sound_run("long_spiral"), factor))
    for key in (RUDDER, ELEVATOR):
        assert sound[key].passed is True
        assert size(sound[key]) == pytest.approx(1.0, abs=0.12)
        assert changed[key].passed is False
        assert size(changed[key]) == pytest.approx(size(sound[key]) / abs(factor), rel=0.02)
        assert "`scale`" in changed[key].advice


@pytest.mark.slow
def test_doubled_coefficients_halve_the_strength(sound_run):
    dataset = sound_run()
    values = dataset.experiment.vehicle.all_coefficients()
    doubled = {symbol: value * (2.0 if symbol.endswith(("dr", "de")) else 1.0) for symbol, value in values.items()}
    vehicle = dataset.experiment.vehicle.with_coefficients(doubled)
    told = replace(dataset, experiment=dataset.experiment.model_copy(update={"vehicle": vehicle}))
    check = verdicts(told)[RUDDER]
    assert check.passed is False
    assert size(check) == pytest.approx(0.5 * size(verdicts(dataset)[RUDDER]), rel=0.02)


@pytest.mark.slow
def test_strength_needs_moving_fin_and_coefficients(sound_run):
    dataset = sound_run()
    empty = dataset.experiment.vehicle.model_copy(
        update={"coefficients": type(dataset.experiment.vehicle.coefficients)()}
    )
    told = replace(dataset, experiment=dataset.experiment.model_copy(update={"vehicle": empty}))
    assert not {RUDDER, ELEVATOR} & {*verdicts(told)}
    assert ELEVATOR not in verdicts(sound_run("zigzag_20_20"))


@pytest.mark.parametrize("half", [2, 5, 40])
def test_rate_of_change_is_savitzky_golay_filter_of_scipy(half, rng):
    values, inner = rng.standard_normal(200), slice(half, 200 - half)
    expected = savgol_filter(values, 2 * half + 1, 3, deriv=1, delta=0.1)
    assert_allclose(rate_of_change(values, 0.1, half)[inner], expected[inner], rtol=1e-10, atol=1e-12)


def test_rates_are_smoothed_like_derivative_of_angle(rng):
    """The angle is the exact integral of rates that are linear from sample to sample."""
    rates, step = rng.standard_normal(200), 0.1
    angle = np.append(0.0, np.cumsum(0.5 * step * (rates[:-1] + rates[1:])))
    assert_allclose(response_to_rates(rates, step, 5), rate_of_change(angle, step, 5), atol=1e-12)
