"""Every provoked fault is caught by a verdict that names it, and sound data pass."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from auvid_cli.config.enums import FilterName
from auvid_cli.data.checks import Checks
from auvid_cli.data.estimate_file import read_estimate, write_estimate
from auvid_cli.data.faults import Fault, FaultTest
from auvid_cli.evaluation.bounds import BoundsOf
from auvid_cli.evaluation.estimate_checks import check_estimate
from auvid_cli.evaluation.innovations import likely_causes
from auvid_cli.evaluation.judgement import judge_one
from auvid_cli.identification.prepared_data import prepare
from auvid_cli.identification.run import identify


def with_values(dataset, name, change):
    """The dataset with some measurements changed by a function of times and values."""
    record = dataset.sensors[name]
    values = record.values.copy()
    change(record.time, values)
    return replace(dataset, sensors=dataset.sensors | {name: replace(record, values=values)})


def stuck(time, values):
    values[(time > 30.0) & (time < 40.0)] = values[np.searchsorted(time, 30.0)]


def silent(time, values):
    values[(time > 30.0) & (time < 40.0)] = np.nan


def wild(time, values):
    values[20::40, 0] += 3.0


@pytest.fixture(scope="module")
def long_enough(simulated_with):
    """White noise only, long enough for every coefficient, and no drawing, from which this vehicle is far."""
    sensors = "sensors.attitude={source: direct, rate: 25 Hz, noise: 0.1 deg}", "sensors.gyroscope.rate=25 Hz"
    return simulated_with("manoeuvre.duration=100 s", *sensors, "vehicle.geometry=null")


@pytest.fixture(scope="module")
def smoothed(long_enough):
    """What judges estimates of these data."""
    return identify(long_enough, FilterName.SMOOTHER)


@pytest.mark.slow
def test_note_on_an_early_end_is_kept_and_shown(short_run, monkeypatch, tmp_path):
    # Whatever is left of the way is said.
    monkeypatch.setattr("auvid_cli.filters.smoother.MIN_DECREASE", 0.0)
    estimate = identify(short_run, FilterName.SMOOTHER)
    assert estimate.completed
    assert estimate.note.startswith("ended where the rest no longer matters (")
    path = tmp_path / "smoother.h5"
    write_estimate(path, estimate)
    assert read_estimate(path).note == estimate.note
    (finished,) = (check for check in verdicts_of(short_run, estimate) if check.check == "finished")
    assert finished.passed is None
    assert estimate.note in finished.advice


def verdicts_of(dataset, estimate):
    prepared = prepare(dataset)
    return check_estimate(prepared, estimate, BoundsOf(prepared)(estimate), judge_one(estimate, None), [])


def verdicts(dataset, filter_name=FilterName.TUKF, reference=None):
    """All, and the names of those that failed, as (subject, check)."""
    estimate, prepared = identify(dataset, filter_name), prepare(dataset)
    causes = likely_causes(reference or estimate)
    checks = check_estimate(prepared, estimate, BoundsOf(prepared)(estimate), judge_one(estimate, reference), causes)
    return checks, {(check.subject, check.check) for check in Checks(checks).failed()}


@pytest.mark.slow
def test_sound_data_pass_everything(long_enough, filter_name, smoothed):
    checks, fails = verdicts(long_enough, filter_name, smoothed)
    assert fails == set()
    assert {check.check for check in checks} >= {
        "finished", "sound", "stuck", "gap", "NIS", "whiteness", "uncorrelated with inputs", "information",
        "identified", "near the bound", "not below the bound", "sign of drag", "sign of fins", "size",
        "within 3 sigma of truth", "NEES",
    }  # fmt: skip
    assert all(check.passed for check in checks)
    assert all(check.advice == "" for check in checks)


def test_that_nobody_has_judged_is_worth_knowing_and_no_failure(long_enough):
    checks, fails = verdicts(long_enough)
    assert fails == set()
    (unjudged,) = [check for check in checks if check.passed is None]
    assert (unjudged.subject, unjudged.check, unjudged.statistic) == ("coefficients", "sound", "unjudged")
    assert unjudged.advice.startswith("not judged")


@pytest.mark.slow
def test_an_estimate_that_is_not_sound_fails_and_says_what_would_help(long_enough, smoothed):
    bias = FaultTest(Fault.parse("bias of r"), "rad/s", 1e-3, 1e-4, "N_url", 2.0)
    checks, fails = verdicts(long_enough, reference=replace(smoothed, faults=(bias,)))
    assert fails == {("coefficients", "sound")}
    (sound,) = [check for check in checks if check.check == "sound"]
    assert "bias of r (0.0573 +- 0.0057 deg/s, 10.0 sigma)" in sound.advice
    assert sound.advice.endswith("identification.estimate.biases: [gyro]).")


@pytest.mark.slow
@pytest.mark.parametrize("sensor", ["gyroscope", "dvl", "attitude"])
def test_a_stuck_sensor_is_named_with_its_time(sensor, long_enough):
    checks, fails = verdicts(with_values(long_enough, sensor, stuck))
    assert {subject for subject, check in fails if check == "stuck"} == {sensor}
    (advice,) = [check.advice for check in checks if (check.subject, check.check) == (sensor, "stuck")]
    assert "from t = 30" in advice
    assert any(check == "NIS" for _, check in fails)


def test_enlarged_noise_of_an_ahrs_is_not_noted(simulated_with):
    checks, _ = verdicts(simulated_with("manoeuvre.duration=60 s"), FilterName.CKF)
    of_attitude = {check.check: check for check in checks if check.subject == "attitude"}
    assert {"NIS", "whiteness", "uncorrelated with inputs"} <= set(of_attitude)
    assert all(check.passed for check in of_attitude.values())
    # The true values are known, so that a drawing shows nothing more.
    names = {check.check for check in checks}
    assert "within 3 sigma of truth" in names
    assert "plausible size" not in names


def test_time_between_two_segments_is_no_gap(long_enough, with_settings):
    two = with_settings(long_enough, "identification.use.spans=[[0, 60], [80, 150]]")
    checks, _ = verdicts(two)
    gaps = [check for check in checks if check.check == "gap"]
    assert len(gaps) == 3
    assert all(check.passed for check in gaps)
    assert any(check.check == "near the bound" for check in checks)


@pytest.mark.slow
def test_a_gap_is_worth_knowing_but_no_failure(long_enough):
    holed = with_values(long_enough, "dvl", silent)
    checks, fails = verdicts(holed, reference=identify(holed, FilterName.SMOOTHER))
    assert fails == set()
    (gap,) = [check for check in checks if check.passed is None]
    assert (gap.subject, gap.check) == ("dvl", "gap")
    assert "30" in gap.statistic


@pytest.mark.slow
def test_outliers_show_and_gated_ones_are_counted(long_enough, with_settings):
    bad = with_values(long_enough, "dvl", wild)
    _, fails = verdicts(bad)
    assert ("dvl", "NIS") in fails
    checks, fails = verdicts(with_settings(bad, "identification.gate=6"))
    assert fails == set()
    (gate,) = [check for check in checks if (check.subject, check.check) == ("dvl", "gate")]
    assert gate.statistic.startswith(f"{len(bad.sensors['dvl'].values[20::40])} of ")
    assert gate.passed is None


def test_a_gate_that_shuts_the_sensor_out_fails(long_enough, with_settings):
    _, fails = verdicts(with_settings(long_enough, "identification.gate=1"))
    assert {subject for subject, check in fails if check == "gate"} == {"gyroscope", "dvl", "attitude"}


@pytest.mark.slow
def test_a_rudder_counted_the_other_way_is_found_by_its_signs(long_enough):
    values = long_enough.inputs.values * [-1.0, 1.0, 1.0, 1.0]
    turned = replace(long_enough, inputs=replace(long_enough.inputs, values=values), truth=None)
    checks, fails = verdicts(turned)
    assert fails == {("coefficients", "sign of fins")}
    (signs,) = [check for check in checks if check.check == "sign of fins"]
    assert signs.statistic == "Y_uudr, N_uudr"


@pytest.mark.slow
def test_half_the_mass_contradicts_the_data(long_enough, with_settings):
    mass = long_enough.experiment.vehicle.known_parameters()["m"]
    light = with_settings(long_enough, f"vehicle.parameters.m={0.5 * mass}")
    _, fails = verdicts(replace(light, truth=None))
    assert {("gyroscope", "NIS"), ("dvl", "NIS"), ("dvl", "uncorrelated with inputs")} <= fails


def test_a_diffuse_prior_diverges_and_says_so(long_enough, with_settings):
    checks, fails = verdicts(with_settings(long_enough, "identification.prior.factor=300"))
    assert ("run", "finished") in fails
    assert "diverged at t =" in checks[0].advice


def test_a_drag_term_that_is_not_excited_is_not_reported_as_known(simulated_with):
    """Straight ahead, without any excitation: sway, heave and the rates stay where they are."""
    still = simulated_with(
        "manoeuvre={type: turning_circle, duration: 60 s, speed: 2 m/s, rudder: 0 deg, excitation: {}}",
        "sensors.attitude={source: direct, rate: 25 Hz, noise: 0.1 deg}",
    )
    checks, fails = verdicts(still)
    assert ("coefficients", "identified") in fails
    (information,) = [check for check in checks if check.check == "information"]
    assert "Y_r|r|" in information.statistic


def test_who_takes_process_noise_for_what_data_need_is_not_told_to_lower_it(long_enough, rng, with_settings):
    """Errors of a gyroscope that last, and a filter that allows for them."""
    gyroscope = long_enough.sensors["gyroscope"]
    noise = rng.standard_normal(gyroscope.values.shape)
    last = lfilter([np.sqrt(1.0 - 0.99**2)], [1.0, -0.99], noise, axis=0) * gyroscope.standard_deviation
    sensors = long_enough.sensors | {"gyroscope": replace(gyroscope, values=gyroscope.values + last)}
    noisy = with_settings(long_enough, "identification.process_noise={velocity: 1e-3, rate: 1e-3, attitude: 1e-5}")
    checks, _ = verdicts(replace(noisy, sensors=sensors), FilterName.CKF)
    verdict = {check.check: check for check in checks}
    assert verdict["near the bound"].passed is None
    assert verdict["near the bound"].advice.startswith("Process noise costs information, and is needed")
    assert verdict["explained by noise"].passed is None
