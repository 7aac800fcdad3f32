"""Independent data distinguish a right from a wrong model."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from auvid_cli.config.enums import FilterName
from auvid_cli.data.innovations import Innovations
from auvid_cli.errors import DataError
from auvid_cli.evaluation.judgement import Grade
from auvid_cli.identification.prepared_data import prepare
from auvid_cli.validation.predictions import HORIZONS
from auvid_cli.validation.results import AHEAD, FREE_RUN
from auvid_cli.validation.validate import validate
from auvid_cli.vehicle.parameters import MOTION_AND_DEPTH_SYMBOLS

from .conftest import FAST, WHITE, ZIGZAG

SLOW = "sensors.gyroscope.rate=25 Hz"
CIRCLE = "manoeuvre={type: turning_circle, duration: 60 s, speed: 3.9 m/s, rudder: -15 deg, approach: 10 s}"


def rows_of(validation, kind):
    return [row for row in validation.predictions if row.kind == kind]


def of_model(validation):
    """Rows without the errors of the vehicle file, which is that of the data."""
    return [row._replace(vehicle_file_rmse=None) for row in validation.predictions]


def free_fits(validation):
    return {row.signal: row.fit_percent for row in rows_of(validation, FREE_RUN)}


@pytest.fixture(scope="module")
def identified(simulated_with):
    """From a spiral."""
    from auvid_cli.identification.run import identify

    return identify(simulated_with("manoeuvre.duration=150 s", WHITE), FilterName.CKF)


NO_NOISE = "identification.process_noise={velocity: 1e-9, rate: 1e-9, attitude: 1e-9, depth: 1e-9}"


@pytest.fixture
def undisturbed(with_coefficients, zigzag, experiment_with):
    """The true coefficients without process noise, like the simulation."""
    return replace(with_coefficients(zigzag.truth.coefficients), experiment=experiment_with(NO_NOISE))


@pytest.mark.slow
def test_true_coefficients_predict_to_within_the_noise(zigzag, undisturbed):
    validation = validate([zigzag], undisturbed)
    ahead = rows_of(validation, AHEAD)
    assert {row.horizon_s for row in ahead} == set(HORIZONS)
    assert {row.signal for row in ahead} == set(MOTION_AND_DEPTH_SYMBOLS)
    for row in ahead:
        low, high = chi2.ppf([1e-4, 1.0 - 1e-4], row.measurements)
        assert low < row.measurements * (row.rmse / row.expected_rmse) ** 2 < high, row
        assert row.noise <= row.expected_rmse < 1.3 * row.noise
    shares = [row.share_within_band for row in ahead]
    assert np.mean(shares) == pytest.approx(0.9545, abs=0.01)
    for row in rows_of(validation, FREE_RUN):
        assert row.rmse == pytest.approx(row.noise, rel=0.15), row
    assert not validation.checks.failed()
    assert all(check.passed for check in validation.checks)
    (remark,) = validation.remarks
    assert "not available" in remark


@pytest.mark.slow
def test_truth_is_ignored(zigzag, with_coefficients):
    estimate = with_coefficients(zigzag.truth.coefficients)
    some = validate([zigzag], estimate, starts=5)
    assert validate([zigzag.without_truth()], estimate, starts=5).predictions == some.predictions


@pytest.mark.slow
def test_spiral_estimate_predicts_zigzag(zigzag, identified):
    validation = validate([zigzag], identified, starts=20)
    fits = free_fits(validation)
    assert min(fits["u"], fits["r"], fits["psi"]) > 90.0
    overshoots = np.array([(n.measured, n.predicted) for n in validation.manoeuvres])
    assert len(overshoots) > 10
    np.testing.assert_allclose(overshoots[:, 1], overshoots[:, 0], atol=np.deg2rad(0.2))
    assert not validation.checks.failed()


@pytest.mark.slow
def test_wrong_rudder_sign_is_worse_than_mean(zigzag, with_coefficients):
    true = zigzag.truth.coefficients
    validation = validate([zigzag], with_coefficients(true, N_uudr=-true["N_uudr"]), starts=15)
    assert free_fits(validation)["r"] < 0.0
    assert {row.fit_percent < 0.0 for row in rows_of(validation, AHEAD) if row.signal == "r"} == {True}
    assert "better than constant velocity" in {check.check for check in validation.checks.failed()}
    assert any("process noise" in remark for remark in validation.remarks)
    # Other models are compared with measurements instead of states of the wrong model.
    known = next(row for row in rows_of(validation, AHEAD) if (row.signal, row.horizon_s) == ("r", 5.0))
    assert known.vehicle_file_rmse < 2.0 * known.noise
    assert known.rmse > 100.0 * known.noise


@pytest.mark.slow
def test_errors_of_the_vehicle_file_do_not_depend_on_the_estimate(zigzag, with_coefficients, experiment_with):
    true = zigzag.truth.coefficients
    some = with_coefficients(true)
    other = replace(
        with_coefficients(true, N_uudr=0.5 * true["N_uudr"]),
        experiment=experiment_with(
            "identification.estimate.biases=[current, gyro]",
            "identification.process_noise.rate=1e-2",
            "identification.delays.dvl=50 ms",
        ),
    )
    of_file = [
        [
            (row.kind, row.signal, row.horizon_s, row.vehicle_file_rmse)
            for row in validate([zigzag], e, starts=12).predictions
        ]
        for e in (some, other)
    ]
    assert of_file[0] == of_file[1]
    assert None not in {rmse for *_, rmse in of_file[0]}


@pytest.mark.slow
def test_unstated_error_fails_uncertainty(zigzag, with_coefficients):
    true = zigzag.truth.coefficients
    off = {"X_u|u|": 1.1 * true["X_u|u|"]}
    uncertain, certain = (validate([zigzag], with_coefficients(true, share, **off), starts=60) for share in (0.1, 1e-6))
    name = "uncertainty not too small"
    (sound,), (failed,) = (
        [check for check in validation.checks if check.check == name] for validation in (uncertain, certain)
    )
    assert sound.passed is True
    assert failed.passed is False
    assert "u at" in failed.statistic


@pytest.mark.slow
def test_diverged_draws_are_counted_and_remarked(zigzag, with_coefficients):
    validation = validate([zigzag], with_coefficients(zigzag.truth.coefficients, share=20.0), starts=12)
    ahead = rows_of(validation, AHEAD)
    assert {row.draws for row in ahead} == {50}
    (blown_up,) = {row.draws_blown_up for row in ahead}
    assert 0 < blown_up <= 50
    assert any(remark.startswith(f"{blown_up} of 50") for remark in validation.remarks)


@pytest.mark.slow
def test_without_a_covariance_there_is_no_band(zigzag, with_coefficients):
    estimate = with_coefficients(zigzag.truth.coefficients)
    validation = validate([zigzag], replace(estimate, covariance=np.full_like(estimate.covariance, np.inf)), starts=12)
    assert {row.share_within_band for row in rows_of(validation, AHEAD)} == {None}
    assert any("no band" in remark for remark in validation.remarks)


@pytest.mark.slow
def test_diverging_free_run_is_unstable(zigzag, with_coefficients):
    true = zigzag.truth.coefficients
    validation = validate([zigzag], with_coefficients(true, **{"X_u|u|": 5.0}), starts=12)
    assert "stable" in {check.check for check in validation.checks.failed()}
    assert free_fits(validation)["u"] is None


@pytest.mark.slow
def test_other_vehicle_is_remarked_and_estimate_used(zigzag, with_coefficients, with_settings):
    estimate = with_coefficients(zigzag.truth.coefficients)
    heavier = with_settings(zigzag, "vehicle.parameters.m=200")
    validation = validate([heavier], estimate, starts=12)
    assert of_model(validation) == of_model(validate([zigzag], estimate, starts=12))
    assert any("another vehicle (m differ)" in remark for remark in validation.remarks)


@pytest.mark.slow
def test_estimated_gyroscope_bias_is_in_predictions(simulated_with, with_coefficients, experiment_with):
    biased = simulated_with(ZIGZAG, WHITE, "seed=31", "sensors.gyroscope.bias=0.5 deg/s")
    plain = with_coefficients(biased.truth.coefficients)
    asking = replace(plain, experiment=experiment_with("identification.estimate.biases=[gyro]"))
    before, after = (validate([biased], estimate, starts=5) for estimate in (plain, asking))
    rates = [row for row in rows_of(after, FREE_RUN) if row.signal in "pqr"]
    assert [row.rmse for row in rates] == pytest.approx([row.noise for row in rates], rel=0.2)
    assert min(row.rmse / row.noise for row in rows_of(before, FREE_RUN) if row.signal in "pqr") > 2.0


@pytest.mark.slow
def test_estimated_current_is_in_predictions(simulated_with):
    from auvid_cli.evaluation.free_run import free_run
    from auvid_cli.identification.run import identify

    current = "manoeuvre.current_north=0.3 m/s", "manoeuvre.current_east=-0.2 m/s"
    asking = "identification.estimate.biases=[current]", "identification.estimate.current.walk=0"
    seen, unseen = (
        simulated_with("manoeuvre.duration=60 s", WHITE, SLOW, *current, *asking, f"seed={seed}") for seed in (1, 2)
    )
    estimate = identify(seen, FilterName.SMOOTHER)
    _, errors = free_run(prepare(seen), estimate)
    # The mean absolute value of white noise is 0.8 of its standard deviation, 1 mm/s.
    assert max(error.mean_absolute_error for error in errors[:3]) < 2e-3
    validation = validate([unseen], estimate, starts=20)
    velocities = [row for row in validation.predictions if row.signal in "uvw"]
    assert min(row.fit_percent for row in velocities) > 97.0
    assert max(row.rmse for row in velocities) < 1e-2
    assert min(row.share_within_band for row in velocities if row.kind == AHEAD) > 0.85
    assert not validation.checks.failed()


@pytest.mark.slow
def test_estimated_disturbance_is_in_predictions_and_bands(simulated_with, with_coefficients, experiment_with):
    """Without these settings predictions are worse and bands too small."""
    force, moment = (
        "{standard_deviation: 20 N, time_constant: 4 s}",
        "{standard_deviation: [0, 0, 8], time_constant: 4}",
    )
    pushes = f"{{force: {force}, moment: {moment}}}"
    pushed = simulated_with(ZIGZAG, "manoeuvre.duration=25 s", WHITE, f"manoeuvre.disturbance={pushes}")
    plain = with_coefficients(pushed.truth.coefficients)
    asking = f"identification.estimate={{biases: [disturbance], disturbance: {pushes}}}"
    told, untold = (
        [
            row
            for row in validate([pushed], estimate, starts=20).predictions
            if row.kind == AHEAD and row.horizon_s <= 1.0
        ]
        for estimate in (replace(plain, experiment=experiment_with(asking)), plain)
    )
    for row, other in zip(told, untold, strict=True):
        if row.signal in "uvr":
            assert row.rmse < 0.9 * other.rmse
            assert row.share_within_band > 0.8 > other.share_within_band


@pytest.mark.slow
def test_turn_in_a_current_is_over_ground(simulated_with, with_coefficients, experiment_with):
    current = "manoeuvre.current_north=0.4 m/s", "manoeuvre.current_east=-0.3 m/s"
    drifting = simulated_with(CIRCLE, "manoeuvre.duration=40 s", WHITE, "seed=31", *current)
    asking = experiment_with("identification.estimate.biases=[current]", "identification.estimate.current.walk=0")
    estimate = replace(with_coefficients(drifting.truth.coefficients), experiment=asking)
    validation = validate([drifting], estimate, starts=12)
    dvl = drifting.sensors["dvl"]
    after = dvl.time > validation.run.time[0]
    drawn = [np.interp(dvl.time[after], validation.run.time, component) for component in validation.run.motion[:, :3].T]
    np.testing.assert_allclose(np.transpose(drawn), dvl.values[after], atol=0.02)
    numbers = {number.number: number for number in validation.manoeuvres}
    time, (north, east, _) = drifting.truth.time, drifting.truth.position.T
    steady = time >= numbers["speed"].time_s
    way = np.hypot(np.diff(north[steady]), np.diff(east[steady])).sum()
    over_ground = way / np.ptp(time[steady])
    u, v, *_ = drifting.truth.motion[steady].T
    assert abs(np.hypot(u, v).mean() - over_ground) > 0.1
    for value in (numbers["speed"].measured, numbers["speed"].predicted):
        assert value == pytest.approx(over_ground, abs=0.01)
    assert numbers["radius"].predicted == pytest.approx(numbers["radius"].measured, rel=5e-3)


@pytest.mark.slow
def test_turn_without_roll_is_level_and_remarked(simulated_with, with_coefficients):
    whole = simulated_with(CIRCLE, WHITE, "seed=5")
    attitude = whole.sensors["attitude"]
    without_roll = replace(attitude, values=attitude.values * [np.nan, 1.0, 1.0])
    blind = replace(whole, sensors=whole.sensors | {"attitude": without_roll})
    seen, unseen = (validate([data], with_coefficients(whole.truth.coefficients), starts=12) for data in (whole, blind))
    assert not any("level" in remark for remark in seen.remarks)
    (remark,) = [remark for remark in unseen.remarks if "level" in remark]
    assert remark.endswith("no sensor measures phi")
    # Depth is held.
    known = {number.number: number.measured for number in seen.manoeuvres}
    for number in unseen.manoeuvres:
        assert number.measured == pytest.approx(known[number.number], rel=0.01, abs=2e-3)
        assert number.predicted == pytest.approx(number.measured, rel=0.01, abs=2e-3)


@pytest.mark.slow
def test_predictions_without_dvl_start_from_model_velocity(zigzag, with_coefficients):
    blind = replace(zigzag, sensors={name: r for name, r in zigzag.sensors.items() if name != "dvl"})
    validation = validate([blind], with_coefficients(zigzag.truth.coefficients), starts=5)
    assert set(free_fits(validation)) == set(MOTION_AND_DEPTH_SYMBOLS[3:])
    assert free_fits(validation)["r"] > 90.0


@pytest.mark.slow
def test_a_short_run_has_short_horizons(simulated_with, with_coefficients):
    short = simulated_with("manoeuvre.duration=15 s", WHITE)
    validation = validate([short], with_coefficients(short.truth.coefficients), starts=20)
    assert {row.horizon_s for row in rows_of(validation, AHEAD)} == {0.5, 1.0, 2.0, 5.0}


def test_diverged_estimate_is_refused(zigzag, with_coefficients):
    estimate = replace(with_coefficients(zigzag.truth.coefficients), status="diverged at t = 3 s: why")
    with pytest.raises(DataError, match="invalid estimate"):
        validate([zigzag], estimate)


def test_too_short_data_are_refused(zigzag, with_coefficients):
    sensors = {
        name: replace(record, time=record.time[record.time < 0.4], values=record.values[record.time < 0.4])
        for name, record in zigzag.sensors.items()
    }
    with pytest.raises(DataError, match="no prediction can start"):
        validate([replace(zigzag, sensors=sensors)], with_coefficients(zigzag.truth.coefficients))


@pytest.mark.slow
def test_errors_on_own_data_widen_bands(zigzag, simulated_with, undisturbed, experiment_with):
    """A mass 5 % off: what comes of it is seen on a spiral, and expected of the zigzag in proportion."""
    own = simulated_with("manoeuvre.duration=100 s", WHITE, FAST, "seed=32")
    mass = 1.05 * undisturbed.experiment.vehicle.known_parameters()["m"]
    heavier = experiment_with(NO_NOISE, f"vehicle.parameters.m={mass}")
    estimate = replace(undisturbed, experiment=heavier)
    without, with_own = (validate([zigzag], estimate, training, starts=20) for training in (None, own))

    def share(validation):
        return np.mean([row.share_within_band for row in rows_of(validation, AHEAD) if row.signal in "vr"])

    assert share(without) < 0.8
    assert share(with_own) > 0.85


@pytest.mark.slow
def test_inconsistent_estimate_keeps_its_judgement(zigzag, with_coefficients):
    time, large = np.arange(100.0), np.full((100, 3), 3.0)
    innovations = {"dvl": Innovations(time, large, np.ones((100, 3)), np.square(large).sum(axis=1), np.ones(3))}
    doubted = validate(
        [zigzag], replace(with_coefficients(zigzag.truth.coefficients), innovations=innovations), starts=5
    )
    assert doubted.judgement.grade is Grade.INCONSISTENT


@pytest.mark.slow
def test_an_estimate_is_judged_by_the_smoother_of_its_own_data(zigzag, with_coefficients):
    estimate = with_coefficients(zigzag.truth.coefficients)
    assert validate([zigzag], estimate, starts=5).judgement.grade is Grade.UNJUDGED
    agreeing = replace(estimate, filter="smoother")
    assert validate([zigzag], estimate, starts=5, reference=agreeing).judgement.grade is Grade.SOUND


@pytest.mark.slow
def test_segments_and_runs_are_combined(zigzag, simulated_with, undisturbed):
    circle = simulated_with(CIRCLE, WHITE, "seed=5")
    segments = [zigzag.sensors_between(2.0, 40.0), zigzag.sensors_between(45.0, 45.3), circle]
    together = validate(segments, undisturbed, starts=30)
    alone = [validate([segment], undisturbed, starts=5) for segment in (segments[0], circle)]
    measured = [sum(row.measurements for row in rows_of(each, FREE_RUN)) for each in (together, *alone)]
    assert measured[0] == measured[1] + measured[2]
    assert {number.manoeuvre for number in together.manoeuvres} == {"zigzag 20", "turning circle 15"}
    for row in rows_of(together, AHEAD):
        assert row.rmse == pytest.approx(row.noise, rel=0.5), row
    assert not together.checks.failed()
    # The free run is that of the longest, and what is too short is said.
    np.testing.assert_array_equal(together.run.motion, alone[1].run.motion)
    assert together.shown.sensors["dvl"].time[-1] == circle.sensors["dvl"].time[-1]
    assert [remark for remark in together.remarks if "too short" in remark]


@pytest.mark.slow
def test_yaw_rate_without_gyroscope_is_compared_with_attitude(zigzag, with_coefficients):
    blind = replace(zigzag, sensors={name: r for name, r in zigzag.sensors.items() if name != "gyroscope"})
    validation = validate([blind], with_coefficients(zigzag.truth.coefficients), starts=5)
    assert free_fits(validation)["r"] > 90.0
    assert any("no gyroscope measures r" in remark for remark in validation.remarks)
