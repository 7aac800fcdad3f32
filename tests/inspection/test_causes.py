"""Likely causes of contradictions between signals."""

from dataclasses import replace

import numpy as np
import pytest

from auvid_cli.data.dataset import SensorRecord
from auvid_cli.inspection.delays import Alignment
from auvid_cli.inspection.fins import RudderTrim
from auvid_cli.inspection.inspect import causes_check, inspect_dataset
from auvid_cli.inspection.inspection import judged, undetermined
from auvid_cli.inspection.kinematic_relations import Grid, Signals
from auvid_cli.inspection.responses import Current
from auvid_cli.inspection.rotation import RateError, rate_errors

DIRECT = "sensors.attitude={source: direct, rate: 20 Hz, noise: 0.1 deg}", "sensors.gyroscope.rate=20 Hz"


def told(simulated_with, *settings):
    checks = inspect_dataset(simulated_with("manoeuvre.duration=60 s", *DIRECT, *settings)).checks
    (causes,) = [check for check in checks if check.check == "likely causes"]
    return causes, {check.check: check for check in checks if check.check.startswith("autocorrelated errors")}


def test_sound_data_have_no_likely_cause(simulated_with):
    causes, lasting = told(simulated_with)
    assert (causes.passed, causes.statistic) == (True, "none")
    assert len(lasting) == 3
    assert all(check.passed for check in lasting.values())


def test_autocorrelated_gyroscope_advises_bias_or_process_noise(simulated_with):
    causes, lasting = told(
        simulated_with, "sensors.gyroscope.coloured_share=0.9", "sensors.gyroscope.coloured_time_constant=4 s"
    )
    assert None in {check.passed for check in lasting.values()}
    assert causes.passed is None
    assert causes.statistic.startswith("autocorrelated errors of the gyroscope")
    assert "more process noise (`auvid tune`)" in causes.advice
    assert "lower" not in causes.advice


@pytest.mark.slow
@pytest.mark.parametrize(
    ("settings", "biases", "does_without"),
    [
        ((), "[gyro, attitude]", True),
        (("identification.attitude_from=inertial",), "[gyro, accelerometer, magnetometer]", False),
        (("sensors.attitude={source: direct, noise: 0.1 deg}",), "[gyro]", False),
    ],
)
def test_advice_on_autocorrelated_errors_fits_the_used_attitude(settings, biases, does_without, simulated_with):
    """The AHRS is mentioned only if one is used, and the biases are valid settings."""
    run = "sensors=sensors/table_iii_bias.yaml", "sensors.gyroscope.bias_spread=1 deg/s", "manoeuvre.duration=100 s"
    dataset = simulated_with(*run, *settings, f"identification.estimate.biases={biases}")
    checks = inspect_dataset(dataset.without_truth()).checks
    advices = {check.advice for check in checks if check.check.startswith("autocorrelated errors") and not check.passed}
    assert advices
    for advice in advices:
        assert f"biases: {biases}" in advice
        assert ("--set identification.attitude_from=inertial" in advice) is does_without


def test_causes_are_sorted_by_gain_without_undetermined_ones():
    late, flow, trim = Alignment(0.5, False, 1.0, gain=30.0), Current(0.3, 0.4, 0.1), RudderTrim(-0.02, 0.002)
    errors = [RateError("r", 0.02, 0.001, 100.0), RateError("q", 0.001, 0.001, 0.0)]
    notes = [
        judged("x", name, statistic="much", threshold="little", passed=None, advice="")
        for name in ("delay", "current", "trim", "autocorrelated errors in r")
    ]
    check = causes_check(late, flow, trim, errors, "gyro", notes)
    assert [part.partition(" (")[0] for part in check.statistic.split("; ")] == [
        "autocorrelated errors of the gyroscope",
        "a rudder trim",
        "delayed inputs",
        "a current",
    ]
    # A gain of half the squared standard errors: 0.5 m/s of 0.1 m/s.
    assert "a current (gains 12 in log-likelihood)" in check.statistic
    assert (
        check.advice.index("[gyro]")
        < check.advice.index("[fin_trim]")
        < check.advice.index("inputs: -0.5 s")
        < check.advice.index("[current]")
    )
    doubted = [undetermined("x", "delay", "nothing turns", ""), *notes[1:]]
    assert "inputs" not in causes_check(late, flow, trim, errors, "gyro", doubted).statistic


@pytest.fixture
def rolling(rng):
    """Function: an hour's tenth of rolling to and fro, measured with white noise, and what else a rate has."""

    def make(added):
        time = 0.1 * np.arange(3600) + 0.05
        phi, p = 0.3 * np.sin(0.8 * time), 0.24 * np.cos(0.8 * time)
        still = np.zeros(time.size)
        noise = rng.standard_normal((2, time.size))
        values = {"p": p + 1e-3 * noise[0] + added(time), "phi": phi + 2e-3 * noise[1]}
        values |= dict.fromkeys(("q", "r", "theta", "psi"), still)
        record = SensorRecord(time, np.zeros((time.size, 3)), np.array([1e-3, 1e-3, 1e-3]))
        sensors = {"gyroscope": record, "attitude": replace(record, standard_deviation=np.full(3, 2e-3))}
        found = rate_errors(Signals(Grid(0.0, 0.1, time.size), values, dict.fromkeys(values, 0.1)), sensors)
        return next(error for error in found if error.rate == "p")

    return make


def test_white_noise_gives_expected_rate_error_for_any_scale_or_delay(rolling):
    # Average over 5 s: 50 rates, and an angle at either end.
    expected = np.sqrt(1e-6 / 50 + 2 * 4e-6 / 25)
    for added in (
        lambda time: 0.0 * time,
        lambda time: 0.01 * np.cos(0.8 * time),
        lambda time: 0.02 * np.sin(0.8 * time),
    ):
        error = rolling(added)
        assert error.expected == pytest.approx(expected)
        assert error.size == pytest.approx(expected, rel=0.25)
        assert not error.is_significant


def test_square_wave_rate_error_has_its_size_and_gain(rolling):
    error = rolling(lambda time: 4e-3 * np.sign(np.sin(0.02 * time)))
    assert error.size == pytest.approx(4e-3, rel=0.1)
    ratio = error.size / error.expected
    # The likelihood of 70 averages of normal noise, of the size that they have and of the stated one.
    assert error.gain == pytest.approx(70 * (0.5 * (ratio**2 - 1.0) - np.log(ratio)), rel=0.05)
    assert error.is_significant
