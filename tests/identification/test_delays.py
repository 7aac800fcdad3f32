"""Delays are found in data at 10 Hz, with what they leave unsure of all else."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from auvid_cli.config.enums import FilterName
from auvid_cli.data.dataset import InputRecord
from auvid_cli.data.estimate import Estimate
from auvid_cli.errors import DataError
from auvid_cli.evaluation.accuracy import sensor_error_results
from auvid_cli.evaluation.bounds import information_with_process_noise, probable_motion
from auvid_cli.evaluation.judgement import judge
from auvid_cli.identification.delays import estimate_delays, unrecorded_time
from auvid_cli.identification.prepared_data import FoundDelays, prepare
from auvid_cli.identification.run import identify, resolve_settings, set_up_filters

LATE, STAMPED = 0.05, 0.03
SOUGHT = "identification.estimate={biases: [delay], delay: {of: [inputs, dvl]}}"


@pytest.fixture(scope="module")
def late(simulated_with):
    """Everything at 10 Hz or less; fins are stamped 50 ms and the DVL 30 ms after they were."""
    dataset = simulated_with(
        "manoeuvre.duration=30 s",
        "manoeuvre.input_rate=10 Hz",
        "sensors.attitude={source: direct, rate: 10 Hz, noise: 0.1 deg}",
        "sensors.gyroscope.rate=10 Hz",
        "sensors.dvl.rate=5 Hz",
        "identification.integration_step=0.05 s",
    )
    dvl = dataset.sensors["dvl"]
    kept = dvl.time < dataset.inputs.time[-1] - 0.1
    later = replace(dvl, time=dvl.time[kept] + STAMPED, values=dvl.values[kept])
    inputs = replace(dataset.inputs, time=dataset.inputs.time + LATE)
    return replace(dataset, inputs=inputs, sensors=dataset.sensors | {"dvl": later})


@pytest.fixture(scope="module")
def prepared(late, with_settings):
    return estimate_delays(prepare(with_settings(late, SOUGHT)))


def off(estimate, truth):
    """Each coefficient's distance from the truth in standard deviations."""
    deviations = estimate.data_deviations()
    found = estimate.final_coefficients()
    return {symbol: abs(found[symbol] - true) / deviations[symbol] for symbol, true in truth.coefficients.items()}


@pytest.mark.slow
def test_delays_are_found_to_ten_milliseconds_and_coefficients_with_them(late, prepared):
    assert_allclose(prepared.delays.value, [-LATE, STAMPED], atol=0.01)
    assert (np.abs(prepared.delays.value - [-LATE, STAMPED]) < 3.0 * prepared.delays.deviation).all()
    assert prepared.experiment.identification.delays == pytest.approx(
        dict(zip(("inputs", "dvl"), prepared.delays.value.tolist(), strict=True)), abs=1e-7
    )
    (run,), chunks = set_up_filters(prepared, [FilterName.CKF]), []
    outcome = run.run(chunks.append)
    assert run.header.state[-2:] == ("delay_inputs", "delay_dvl")
    assert outcome.covariance.shape == (len(run.header.state),) * 2
    assert chunks[-1].mean[-1, -2:] == pytest.approx(prepared.delays.value)


@pytest.mark.slow
def test_ignored_delays_make_the_estimate_inconsistent(late, prepared):
    blind = identify(late, FilterName.SMOOTHER)
    (run,), chunks = set_up_filters(prepared, [FilterName.SMOOTHER]), []
    outcome = run.run(chunks.append)
    seeing = Estimate.of(run.header, chunks, outcome)
    assert max(off(blind, late.truth).values()) > 3.5
    assert max(off(seeing, late.truth).values()) < 3.5
    assert [judge([estimate])["smoother"].grade for estimate in (blind, seeing)] == ["inconsistent", "sound"]
    rows = {row.state: row for row in sensor_error_results(seeing)}
    assert rows["delay_inputs"].observed
    assert rows["delay_dvl"].estimate == pytest.approx(STAMPED, abs=0.01)
    # An estimated delay is not a fault.
    assert {"delay of the inputs", "delay of the DVL"}.isdisjoint(str(test.fault) for test in seeing.faults)


@pytest.mark.slow
def test_unknown_delay_widens_covariance(late, prepared, with_settings):
    stated = with_settings(late, f"identification.delays={{inputs: {-LATE}, dvl: {STAMPED}}}")
    known, sought = (
        information_with_process_noise(probable_motion(data, late.truth.coefficients)).bound()
        for data in (prepare(stated), prepared)
    )
    assert sought["delay_inputs"] < 0.01
    assert all(sought[symbol] >= known[symbol] * (1.0 - 1e-6) for symbol in known)
    assert max(sought[symbol] / known[symbol] for symbol in known) > 1.1


@pytest.mark.slow
def test_delays_of_raw_sensors_are_found_to_ten_milliseconds(simulated_with):
    """Delays of an accelerometer off the origin and of a three-axis magnetometer, without an AHRS."""
    late = {"accelerometer": 0.04, "magnetic_field": -0.03}
    dataset = simulated_with(
        "manoeuvre.duration=8 s",
        "manoeuvre.input_rate=20 Hz",
        "sensors.accelerometer={rate: 20 Hz, noise: 1 cm/s^2, position: [0.4 m, -0.2 m, 0.1 m]}",
        "sensors.magnetometer=null",
        "sensors.attitude.source=direct",
        "sensors.magnetic_field={rate: 20 Hz, noise: 0.1 uT, strength: 48 uT, declination: 2 deg, dip: 64 deg}",
        "sensors.gyroscope.rate=20 Hz",
        "identification.integration_step=0.05 s",
        "identification.attitude_from=inertial",
        f"identification.estimate={{biases: [delay], delay: {{of: [{', '.join(late)}]}}}}",
    )
    end = dataset.inputs.time[-1]
    shifted = {
        name: replace(dataset.sensors[name], time=dataset.sensors[name].time + by).between(0.0, end)
        for name, by in late.items()
    }
    found = estimate_delays(prepare(replace(dataset, sensors=dataset.sensors | shifted))).delays
    assert found.symbols == ("delay_accelerometer", "delay_magnetic_field")
    error = np.abs(found.value - [*late.values()])
    assert (error < 0.01).all()
    assert (error < 3.0 * found.deviation).all()


def test_delay_uncertainty_is_propagated_to_coefficients():
    """Against the covariance of a linear function of independent errors."""
    rng = np.random.default_rng(1)
    effect, own, root = rng.standard_normal((3, 2)), rng.standard_normal((5, 5)), rng.standard_normal((2, 2))
    delays = FoundDelays(("a", "b"), np.array([0.1, 0.2]), root @ root.T, effect)
    by_delay = np.vstack([effect, np.zeros((2, 2))])
    whole = np.block([[own, by_delay @ root], [np.zeros((2, 5)), root]])
    covariance, deviation = own @ own.T, np.linalg.norm(own, axis=1)
    assert_allclose(delays.joint(covariance), whole @ whole.T, atol=1e-12)
    mean, wider = delays.along(np.zeros((1, 5)), deviation[None])
    assert_allclose(wider[0], np.linalg.norm(whole, axis=1))
    assert_allclose(mean[0], [0.0, 0.0, 0.0, 0.0, 0.0, 0.1, 0.2])


def test_few_input_changes_widen_the_delay():
    """A uniform error of an interval, of as many steps as there are."""
    time = 0.1 * np.arange(101)
    steps = np.where(np.arange(101) % 10 < 5, 0.1, -0.1)
    values = np.column_stack([steps, *np.zeros((3, 101))])
    changes = np.count_nonzero(np.diff(steps))
    assert unrecorded_time(InputRecord(time, values)) == pytest.approx(0.1 / np.sqrt(12.0 * changes))
    assert unrecorded_time(InputRecord(time, 0.0 * values)) == 0.0


def test_delay_of_a_missing_sensor_is_refused(late, with_settings):
    asked = with_settings(late, "identification.estimate={biases: [delay], delay: {of: [depth]}}")
    with pytest.raises(DataError, match=r"delay\.of: depth.*expected"):
        resolve_settings(prepare(asked))
